import { fit, showView, zoom } from "../camera/move";
import { CompareMenu } from "../compare/menu";
import { setKey } from "../state/edit";
import { endStep, look } from "../state/history";
import { mesh } from "../state/mesh";
import { strings } from "../strings";

const VIEWS = ["iso", "front", "back", "left", "right", "top", "bottom"] as const;
const BACKGROUNDS = {
  white: "#fff",
  grey: "#f4f6f9..#c3cad4",
  dark: "#2a2f37..#14171c",
  transparent: "transparent",
} as const;

/** Buttons for the camera, the background and comparisons. */
export function Toolbar() {
  return (
    <div class="toolbar" role="toolbar" aria-label={strings.picture.tools}>
      <ZoomButtons />
      <ViewButtons />
      <BackgroundButtons />
      <span class="spring" />
      {mesh.value && <CompareMenu />}
    </div>
  );
}

function ZoomButtons() {
  return (
    <div class="group">
      <button
        type="button"
        onClick={() => {
          endStep();
          fit();
        }}
        data-test="fit"
        title={strings.picture.fit}
      >
        {strings.picture.fit}
      </button>
      <button
        type="button"
        onClick={() => void zoom(1 / 1.25)}
        aria-label={strings.picture.zoomOut}
        title={strings.picture.zoomOut}
        data-test="zoom-out"
      >
        −
      </button>
      <button
        type="button"
        onClick={() => void zoom(1.25)}
        aria-label={strings.picture.zoomIn}
        title={strings.picture.zoomIn}
        data-test="zoom-in"
      >
        +
      </button>
    </div>
  );
}

function ViewButtons() {
  const view = String(look.value.keys["camera.view"] ?? "");
  return (
    <div class="group views" role="group" aria-label={strings.picture.view}>
      {VIEWS.map((name) => (
        <button
          type="button"
          key={name}
          class="segment"
          aria-pressed={view === name}
          data-test={`view-${name}`}
          onClick={() => {
            endStep();
            showView(name);
          }}
        >
          {strings.picture.views[name]}
        </button>
      ))}
    </div>
  );
}

function BackgroundButtons() {
  const background = look.value.keys["image.background"] ?? "#fff";
  return (
    <div class="group backgrounds" role="group" aria-label={strings.picture.background}>
      {(Object.keys(BACKGROUNDS) as (keyof typeof BACKGROUNDS)[]).map((name) => (
        <button
          type="button"
          key={name}
          class={`swatch bg-${name}`}
          aria-pressed={background === BACKGROUNDS[name]}
          aria-label={strings.picture.backgrounds[name]}
          title={strings.picture.backgrounds[name]}
          data-test={`background-${name}`}
          onClick={() => {
            endStep();
            setKey("image.background", name === "white" ? undefined : BACKGROUNDS[name]);
          }}
        />
      ))}
    </div>
  );
}
