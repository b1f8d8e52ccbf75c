import { signal } from "@preact/signals";
import { resetAll, setKey, setKeys } from "../state/edit";
import { canRedo, canUndo, endStep, look, redo, undo } from "../state/history";
import type { Keys, Value } from "../state/look";
import { refusedKey } from "../state/phase";
import { CUTS, strings, synonyms } from "../strings";
import { type Edit, FieldRow } from "./field";
import { type Field, type Section, sectionsOf, type Schema } from "./schema";

export const schema = signal<Schema | null>(null);
export const search = signal("");
const opened = signal<ReadonlySet<string>>(new Set(["wire"]));

/** The settings: every key of the server's schema, by section. */
export function Controls() {
  if (!schema.value) return <p class="quiet">{strings.loading}</p>;
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const sections = sectionsOf(schema.value)
    .map((section) => ({ ...section, fields: section.fields.filter((field) => matches(field, words)) }))
    .filter(({ fields }) => fields.length > 0);
  return (
    <div class="controls">
      <div class="controls-head">
        <input
          type="search"
          placeholder={strings.controls.search}
          aria-label={strings.controls.search}
          value={search.value}
          data-test="search"
          onInput={(e) => (search.value = e.currentTarget.value)}
        />
        <button
          type="button"
          onClick={undo}
          disabled={!canUndo.value}
          title={strings.controls.undo}
          aria-label={strings.controls.undo}
          data-test="undo"
        >
          ↶
        </button>
        <button
          type="button"
          onClick={redo}
          disabled={!canRedo.value}
          title={strings.controls.redo}
          aria-label={strings.controls.redo}
          data-test="redo"
        >
          ↷
        </button>
        <button type="button" onClick={resetAll} data-test="reset-all" title={strings.controls.resetAllHelp}>
          {strings.controls.resetAll}
        </button>
      </div>
      {sections.length === 0 && (
        <p class="quiet">
          {CUTS.test(search.value) ? strings.controls.noCuts : strings.controls.noMatch(search.value)}
        </p>
      )}
      {sections.map((section) => (
        <SectionGroup
          key={section.name}
          section={section}
          keys={look.value.keys}
          scope=""
          searching={words.length > 0}
          put={put}
        />
      ))}
    </div>
  );
}

/** Sets a key. A layer that is off comes on with its first key. */
function put(section: string, key: string, value: Value | undefined): void {
  if (section && look.value.keys[section] === null) setKeys(key, { [section]: undefined, [key]: value });
  else setKey(key, value);
}

function matches(field: Field, words: string[]): boolean {
  const text =
    `${field.key.replaceAll("_", " ")} ${field.key} ${field.description} ${field.words.join(" ")}`.toLowerCase();
  const isMeant = (word: string) =>
    Object.hasOwn(synonyms, word) &&
    synonyms[word]?.some((key) => field.key === key || field.key.startsWith(`${key}.`));
  return words.every((word) => text.includes(word) || isMeant(word));
}

interface GroupProps {
  section: Section;
  keys: Keys;
  scope: string;
  searching: boolean;
  put(section: string, key: string, value: Value | undefined): void;
}

/** A section that can be folded, with a mark for how many of its keys are set. */
export function SectionGroup({ section, keys, scope, searching, put: set }: GroupProps) {
  const id = scope + section.name;
  const count = Object.keys(keys).filter((key) => key === section.name || key.startsWith(`${section.name}.`)).length;
  const refused = refusedKey.value?.startsWith(`${section.name}.`) ?? false;
  const isOpen = searching || refused || opened.value.has(id);
  const flip = (open: boolean) => {
    if (searching || open === opened.value.has(id)) return;
    const next = new Set(opened.value);
    if (open) next.add(id);
    else next.delete(id);
    opened.value = next;
  };
  const name = section.name || strings.controls.general;
  return (
    <details
      class="section"
      open={isOpen}
      onToggle={(e) => flip(e.currentTarget.open)}
      data-test={`section-${id || "general"}`}
    >
      <summary>
        <span class="section-name">{name}</span>
        {count > 0 && section.name && (
          <span class="count" title={strings.controls.setKeys(count)}>
            {count}
          </span>
        )}
        <span class="section-text">{section.description}</span>
      </summary>
      {isOpen && section.layer && <LayerSwitch section={section} keys={keys} scope={scope} put={set} />}
      {isOpen &&
        section.fields.map((field) => {
          const edit: Edit = { value: keys[field.key], set: (value) => set(section.name, field.key, value), scope };
          return <FieldRow key={field.key} field={field} edit={edit} explain={searching} />;
        })}
    </details>
  );
}

/** Turns a layer on or off, or leaves it to the style. */
function LayerSwitch({ section, keys, scope, put: set }: Omit<GroupProps, "searching">) {
  const stated = keys[section.name];
  const below = Object.keys(keys).some((key) => key.startsWith(`${section.name}.`));
  const state = stated === null ? "off" : stated !== undefined || below ? "on" : "style";
  const choose = (next: string) => {
    endStep();
    if (next === "off") return set("", section.name, null);
    if (next === "on") return set("", section.name, below ? undefined : {});
    set("", section.name, undefined);
    for (const key of Object.keys(keys)) if (key.startsWith(`${section.name}.`)) set("", key, undefined);
  };
  const label = section.name === "sheet" ? strings.controls.none : strings.controls.byStyle;
  return (
    <div class="segments layer" role="group" aria-label={strings.controls.layer(section.name)}>
      {[
        ["style", label],
        ["on", strings.controls.on],
        ["off", strings.controls.off],
      ]
        .filter(([value]) => !(section.name === "sheet" && value === "off"))
        .map(([value, text]) => (
          <button
            type="button"
            class="segment"
            key={value}
            aria-pressed={state === value}
            data-test={`layer-${scope}${section.name}-${value}`}
            onClick={() => choose(value ?? "")}
          >
            {text}
          </button>
        ))}
    </div>
  );
}
