import { endStep } from "../state/history";
import { touch } from "../picture/live";
import { strings } from "../strings";
import type { Edit } from "./field";
import { digitsOf } from "./named";

const SWATCHES = ["#000000", "#ffffff", "#e02020", "#f05a1e", "#f2b705", "#2a9d5b", "#1f6feb", "#8c96a0"];

/** A colour of six digits for the browser's own picker, which knows no others. */
export function opaque(colour: string): string {
  const digits = colour.replace(/^#/, "");
  if (/^[0-9a-f]{3,4}$/i.test(digits)) return `#${[...digits.slice(0, 3)].map((d) => d + d).join("")}`;
  return /^[0-9a-f]{6}/i.test(digits) ? `#${digits.slice(0, 6)}` : "#808080";
}

interface Props {
  id: string;
  edit: Edit;
  fallback: unknown;
  /** True for keys whose null draws nothing. */
  mayBeNone: boolean;
}

/** A colour: the browser's picker, text for all that the key takes, and swatches. */
export function ColourInput({ id, edit, fallback, mayBeNone }: Props) {
  const stated = edit.value === undefined ? fallback : edit.value;
  const text = typeof stated === "string" ? stated : "";
  const none = strings.controls.noColour;
  const pick = (colour: string) => {
    endStep();
    if (colour === "") edit.set(undefined);
    else if (mayBeNone && colour === none) edit.set(null);
    else edit.set(digitsOf(colour));
  };
  return (
    <div class="colour">
      <input
        type="color"
        value={opaque(text || "#808080")}
        class={text ? "" : "is-unset"}
        aria-label={strings.controls.picker(id)}
        onInput={(e) => {
          touch();
          edit.set(e.currentTarget.value);
        }}
      />
      <input
        type="text"
        id={id}
        value={edit.value === null ? none : text}
        placeholder={mayBeNone ? none : strings.controls.byDefault}
        spellcheck={false}
        onChange={(e) => {
          const typed = e.currentTarget.value.trim();
          pick(typed);
          if (typed !== "" && typed !== none) e.currentTarget.value = digitsOf(typed);
        }}
      />
      <span class="swatches">
        {SWATCHES.map((colour) => (
          <button
            type="button"
            key={colour}
            class={`swatch s${colour.slice(1)}`}
            title={colour}
            tabIndex={-1}
            aria-label={strings.controls.swatch(id, colour)}
            onClick={() => pick(colour)}
          />
        ))}
        {mayBeNone && (
          <button
            type="button"
            class="small"
            aria-pressed={edit.value === null}
            onClick={() => pick(none)}
            data-test={`none-${id}`}
          >
            {none}
          </button>
        )}
      </span>
    </div>
  );
}
