import { signal } from "@preact/signals";
import { setMaterialKey } from "../state/edit";
import { look } from "../state/history";
import type { Value } from "../state/look";
import { report } from "../state/mesh";
import { strings } from "../strings";
import { schema, SectionGroup } from "./controls";
import { materialSectionsOf } from "./schema";

const SHOWN_AT_ONCE = 60;
const filter = signal("");
const chosen = signal<string | null>(null);
const more = signal(SHOWN_AT_ONCE);

/** Layers of single materials, by the names that the mesh has for them. */
export function Materials() {
  const names = (report.value?.materials ?? []).filter((name) => name !== "");
  if (!report.value) return <p class="quiet">{strings.loading}</p>;
  if (names.length === 0) return <p class="quiet">{strings.materials.none}</p>;
  const found = names.filter((name) => name.toLowerCase().includes(filter.value.toLowerCase()));
  return (
    <div class="materials" data-test="materials">
      <p class="quiet">{strings.materials.help}</p>
      {names.length > 8 && (
        <input
          type="search"
          placeholder={strings.materials.search(names.length)}
          aria-label={strings.materials.search(names.length)}
          value={filter.value}
          onInput={(e) => {
            filter.value = e.currentTarget.value;
            more.value = SHOWN_AT_ONCE;
          }}
        />
      )}
      <ul class="material-list">
        {found.slice(0, more.value).map((name) => (
          <Material key={name} name={name} />
        ))}
      </ul>
      {found.length > more.value && (
        <button type="button" onClick={() => (more.value += SHOWN_AT_ONCE)}>
          {strings.materials.more(found.length - more.value)}
        </button>
      )}
    </div>
  );
}

function Material({ name }: { name: string }) {
  const keys = look.value.materials[name] ?? {};
  const count = Object.keys(keys).length;
  const open = chosen.value === name;
  const put = (section: string, key: string, value: Value | undefined) => {
    if (section && keys[section] === null) setMaterialKey(name, section, undefined);
    setMaterialKey(name, key, value);
  };
  return (
    <li>
      <button
        type="button"
        class="material"
        aria-expanded={open}
        data-test={`material-${name}`}
        onClick={() => (chosen.value = open ? null : name)}
      >
        <bdi>{name}</bdi>
        {count > 0 && <span class="count">{count}</span>}
      </button>
      {open &&
        schema.value &&
        materialSectionsOf(schema.value).map((section) => (
          <SectionGroup
            key={section.name}
            section={section}
            keys={keys}
            scope={`materials.${name}.`}
            searching={false}
            put={put}
          />
        ))}
    </li>
  );
}
