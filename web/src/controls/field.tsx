import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { hold, touch } from "../picture/live";
import { endStep } from "../state/history";
import type { Value } from "../state/look";
import { refusedKey, pictureRefusal } from "../state/phase";
import { strings } from "../strings";
import { ColourInput } from "./colour";
import { backgroundOf } from "./named";
import { kept, labelOf, rangeOf } from "./ranges";
import type { Field } from "./schema";
import { SectionPlanes } from "./section-planes";

export interface Edit {
  value: Value | undefined;
  set(value: Value | undefined): void;
  /** Prefix that makes ids unique where a key has several controls. */
  scope: string;
}

const helpOf = signal<string | null>(null);

/** One key with its control, its description and a button that resets it. */
export function FieldRow({ field, edit, explain }: { field: Field; edit: Edit; explain: boolean }) {
  const { label, unit } = labelOf(field.name);
  const id = `${edit.scope}${field.key}`;
  const refused = refusedKey.value === id || refusedKey.value === field.key;
  const isSet = edit.value !== undefined;
  const open = explain || helpOf.value === id;
  const classes = ["field", isSet ? "is-set" : "", refused ? "is-refused" : ""].join(" ");
  return (
    <div class={classes} data-test={`field-${id}`} data-key={id}>
      <div class="field-head">
        <label for={id} id={`${id}-label`}>
          {label}
          {unit && <span class="unit">{unit === "°" ? unit : `\u00a0${unit}`}</span>}
        </label>
        <button
          class="help"
          type="button"
          aria-expanded={open}
          aria-label={strings.controls.help(field.key)}
          onClick={() => (helpOf.value = open ? null : id)}
        >
          ?
        </button>
      </div>
      <Control field={field} edit={edit} id={id} />
      {isSet && (
        <button
          class="reset"
          type="button"
          title={strings.controls.reset(field.key)}
          aria-label={strings.controls.reset(field.key)}
          data-test={`reset-${id}`}
          onClick={() => {
            endStep();
            edit.set(undefined);
          }}
        >
          ↺
        </button>
      )}
      {open && (
        <p class="description" id={`${id}-help`}>
          {field.description} <code>{id}</code>
        </p>
      )}
      {refused && (
        <p class="refusal" role="alert">
          {pictureRefusal.value?.message}
        </p>
      )}
    </div>
  );
}

interface Props {
  field: Field;
  edit: Edit;
  id: string;
}

function Control(props: Props) {
  if (props.field.key === "scene.section") return <SectionPlanes edit={props.edit} id={props.id} />;
  switch (props.field.kind) {
    case "choice":
      return <Choice {...props} />;
    case "boolean":
      return <Switch {...props} />;
    case "number":
      return <Numeric {...props} />;
    case "colour":
      return (
        <ColourInput
          id={props.id}
          edit={props.edit}
          fallback={props.field.default}
          mayBeNone={props.field.section === "topology"}
        />
      );
    case "list":
      return <Several {...props} />;
    default:
      return <TextInput {...props} />;
  }
}

function Choice({ field, edit, id }: Props) {
  const standard =
    field.default === undefined || field.default === null ? strings.controls.byDefault : String(field.default);
  const pick = (text: string) => {
    endStep();
    edit.set(text === "" ? undefined : field.words.find((word) => String(word) === text));
  };
  const words = field.words.filter((word) => !(word === "jpg" && field.words.includes("jpeg")));
  if (words.length <= 3) {
    const current = edit.value ?? field.default;
    return (
      <Group labelled={`${id}-label`} id={id}>
        {words.map((word) => (
          <button
            type="button"
            class="segment"
            aria-pressed={current === word}
            key={word}
            data-test={`choice-${id}-${word}`}
            onClick={() => pick(String(word))}
          >
            {word}
          </button>
        ))}
      </Group>
    );
  }
  return (
    <select
      id={id}
      value={edit.value === undefined ? "" : String(edit.value)}
      onChange={(e) => pick(e.currentTarget.value)}
    >
      <option value="">{strings.controls.standard(standard)}</option>
      {words.map((word) => (
        <option value={String(word)} key={word}>
          {word}
        </option>
      ))}
    </select>
  );
}

function Group({ labelled, id, children }: { labelled: string; id: string; children: ComponentChildren }) {
  return (
    <div class="segments" role="group" aria-labelledby={labelled} id={id}>
      {children}
    </div>
  );
}

function Switch({ field, edit, id }: Props) {
  const on = (edit.value ?? field.default) === true;
  return (
    <input
      type="checkbox"
      class="switch"
      role="switch"
      id={id}
      checked={on}
      onChange={(e) => {
        endStep();
        edit.set(e.currentTarget.checked);
      }}
    />
  );
}

function Numeric({ field, edit, id }: Props) {
  const range = rangeOf(field);
  const stated = edit.value ?? field.default;
  const number = typeof stated === "number" ? stated : null;
  const put = (text: string) => {
    const value = Number(text);
    if (text === "" || field.words.includes(text)) edit.set(text === "" ? undefined : text);
    else if (Number.isFinite(value)) edit.set(kept(field, value));
  };
  const putTyped = (box: HTMLInputElement) => {
    const text = box.value.trim();
    put(text);
    // The box shows what was taken, also where that is what it was before.
    if (text !== "" && Number.isFinite(Number(text))) box.value = String(kept(field, Number(text)));
  };
  const hint = field.words.length > 0 ? field.words.join(", ") : strings.controls.byDefault;
  return (
    <div class="numeric">
      {range && (
        <input
          type="range"
          {...range}
          step={range.step}
          value={number ?? range.min}
          tabIndex={-1}
          class={number === null ? "is-unset" : ""}
          aria-label={strings.controls.slider(field.key)}
          onPointerDown={() => {
            endStep();
            hold(true);
          }}
          onPointerUp={() => hold(false)}
          onPointerCancel={() => hold(false)}
          onChange={() => hold(false)}
          onInput={(e) => put(e.currentTarget.value)}
        />
      )}
      <input
        type="text"
        id={id}
        inputMode="decimal"
        placeholder={number === null ? hint : ""}
        value={
          edit.value === undefined || edit.value === null ? String(number ?? field.words[0] ?? "") : String(edit.value)
        }
        onFocus={endStep}
        onChange={(e) => putTyped(e.currentTarget)}
        onKeyDown={(e) => stepByKey(e, number ?? range?.min ?? 0, range?.step ?? 1, put)}
      />
    </div>
  );
}

/** Up and down change a number by a step, or by ten with Shift, within the slider's precision. */
function stepByKey(event: KeyboardEvent, from: number, step: number, put: (text: string) => void): void {
  const sign = event.key === "ArrowUp" ? 1 : event.key === "ArrowDown" ? -1 : 0;
  if (sign === 0) return;
  event.preventDefault();
  touch();
  put(String(Number((from + sign * step * (event.shiftKey ? 10 : 1)).toPrecision(8))));
}

function Several({ field, edit, id }: Props) {
  const stated = (edit.value ?? field.default ?? []) as Value[];
  const flip = (word: string | number) => {
    endStep();
    const next = stated.includes(word) ? stated.filter((one) => one !== word) : [...stated, word];
    edit.set(next.length > 0 ? next : undefined);
  };
  return (
    <Group labelled={`${id}-label`} id={id}>
      {field.words.map((word) => (
        <button
          type="button"
          class="segment"
          aria-pressed={stated.includes(word)}
          key={word}
          onClick={() => flip(word)}
        >
          {word}
        </button>
      ))}
    </Group>
  );
}

/** Points as `1, 2, 3`, sections as JSON, all else as it is. */
function TextInput({ field, edit, id }: Props) {
  const stated = edit.value ?? field.default;
  const text = stated === undefined || stated === null ? "" : writeText(stated as Value);
  const put = (typed: string) => {
    endStep();
    edit.set(typed.trim() === "" ? undefined : readText(field, typed));
  };
  const hint = field.kind === "vector" ? "x, y, z" : strings.controls.byDefault;
  return (
    <input
      type="text"
      id={id}
      value={text}
      placeholder={hint}
      spellcheck={false}
      onChange={(e) => put(e.currentTarget.value)}
    />
  );
}

function writeText(value: Value): string {
  if (Array.isArray(value) && value.every((v) => typeof v === "number")) return value.join(", ");
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

function readText(field: Field, typed: string): Value {
  if (field.kind === "vector")
    return typed
      .split(/[\s,]+/)
      .filter(Boolean)
      .map((part) => Number(part))
      .filter(Number.isFinite);
  if (field.kind === "background") return backgroundOf(typed.trim());
  if (field.kind !== "json") return typed.trim();
  try {
    return JSON.parse(typed) as Value;
  } catch {
    return typed;
  }
}
