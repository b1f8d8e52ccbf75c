import { useEffect, useRef } from "preact/hooks";
import { isAtFault } from "../camera/move";
import { showKey, tab } from "../app/tab";
import { CompareLayer, HeatText, SideNames } from "../compare/layer";
import { compare } from "../compare/state";
import { controlName } from "../controls/ranges";
import { setKey } from "../state/edit";
import { canUndo, endStep, look } from "../state/history";
import { report } from "../state/mesh";
import { connection, pictureRefusal } from "../state/phase";
import { room, shownSize } from "../state/size";
import { strings } from "../strings";
import { gestures } from "./gestures";
import { busy, finished, shown } from "./live";
import { Legend } from "./legend";
import { Toolbar } from "./toolbar";

/** The picture, with all that turns it. */
export function Stage() {
  const frame = useRef<HTMLDivElement>(null);
  const picture = useRef<HTMLDivElement>(null);
  useEffect(() => observe(frame.current!), []);
  useEffect(() => gestures(picture.current!), []);
  return (
    <section class="stage" aria-label={strings.picture.stage.split(".")[0]}>
      <Toolbar />
      <div class="frame" ref={frame}>
        <div
          class="picture"
          ref={picture}
          tabIndex={0}
          role="application"
          aria-label={strings.picture.stage}
          aria-busy={busy.value}
          data-test="stage"
        >
          <PictureImage />
          <CompareLayer />
        </div>
        <Hint />
        <Legend />
        <SideNames />
        <HeatText />
        {isAtFault() && <span class="fault-mark" aria-hidden="true" data-test="fault-mark" />}
        {busy.value && <span class="progress" aria-hidden="true" />}
        <Warnings />
        <Messages />
      </div>
    </section>
  );
}

/** Keeps the room for the picture up to date. */
function observe(frame: HTMLElement): () => void {
  const observer = new ResizeObserver(() => {
    const next = { width: Math.floor(frame.clientWidth), height: Math.floor(frame.clientHeight) };
    const { width, height } = room.peek();
    if (next.width !== width || next.height !== height) room.value = next;
  });
  observer.observe(frame);
  return () => observer.disconnect();
}

function PictureImage() {
  const current = shown.value;
  const box = useRef<HTMLImageElement>(null);
  const { width, height } = shownSize.value;
  useEffect(() => {
    if (!box.current) return;
    box.current.style.width = `${width}px`;
    box.current.style.height = `${height}px`;
  });
  if (!current) return null;
  const style = String(current.picture.look.keys["style"] ?? "auto");
  const transparent = look.value.keys["image.background"] === "transparent";
  return (
    <img
      ref={box}
      class={`shot ${transparent ? "is-transparent" : ""}`}
      src={current.url}
      draggable={false}
      alt={strings.picture.alt(current.picture.mesh.name, style)}
      data-test="picture"
      data-draft={current.draft}
      data-path={current.path}
      data-finished={finished.value?.path}
    />
  );
}

/** How the picture is turned, until it has been turned once. */
function Hint() {
  const keys = look.value.keys;
  if (
    canUndo.value ||
    "camera.azimuth_deg" in keys ||
    "camera.eye" in keys ||
    compare.value ||
    warningCodes().length > 0
  )
    return null;
  const text = matchMedia("(hover: none)").matches ? strings.picture.touchHint : strings.picture.hint;
  return (
    <span class="hint" aria-hidden="true">
      {text}
    </span>
  );
}

function warningCodes(): string[] {
  return (finished.value?.headers.get("x-warnings") ?? "")
    .split(",")
    .map((code) => code.trim())
    .filter(Boolean);
}

/** Warnings of the picture; those that the mesh's report has, too, in its words. */
function Warnings() {
  const codes = warningCodes();
  if (codes.length === 0 || pictureRefusal.value) return null;
  const stated = report.value?.warnings ?? [];
  const texts = codes.map((code) => stated.find((one) => one.code === code)?.detail ?? code.replaceAll("_", " "));
  return (
    <button
      type="button"
      class="warning-mark"
      title={texts.join("\n")}
      data-test="warnings"
      onClick={() => (tab.value = "explain")}
    >
      {strings.picture.warning(texts.join("; "))}
    </button>
  );
}

function Messages() {
  const refusal = pictureRefusal.value;
  if (!refusal || connection.value.kind !== "good") return null;
  const { key } = refusal;
  return (
    <div class="message is-refusal" role="alert" data-test="picture-refusal">
      <strong>{key ? strings.picture.refusedControl(controlName(key), key) : strings.picture.refused}</strong>
      <span>{refusal.message}</span>
      {key && (
        <span class="group">
          <button type="button" class="small" onClick={() => showKey(key)} data-test="show-key">
            {strings.picture.showKey(controlName(key))}
          </button>
          {key in look.value.keys && (
            <button
              type="button"
              class="small"
              data-test="reset-refused"
              onClick={() => {
                endStep();
                setKey(key, undefined);
              }}
            >
              {strings.controls.reset(controlName(key))}
            </button>
          )}
        </span>
      )}
    </div>
  );
}
