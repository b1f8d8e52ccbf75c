import { useRef } from "preact/hooks";
import { filesOfInput } from "../files/drop";
import { store } from "../files/open";
import { applyLook } from "../state/edit";
import { phase } from "../state/phase";
import { strings } from "../strings";
import type { NamedFile } from "../api/upload";
import { compare, type Compared, compareMesh, endCompare, heat, keepLook } from "./state";

/** Stores another mesh and shows it beside the one that is open. */
export async function compareFiles(files: NamedFile[]): Promise<void> {
  const other = await store(files, null);
  if (!other) return;
  phase.value = { kind: "open" };
  compareMesh(other);
}

/** Begins a comparison, or says what can be done with the one that is on. */
export function CompareMenu() {
  return compare.value ? <CompareTools compared={compare.value} /> : <CompareStart />;
}

function CompareStart() {
  const input = useRef<HTMLInputElement>(null);
  return (
    <div class="group compare-menu">
      <span class="label">{strings.compare.start}</span>
      <button
        type="button"
        onClick={keepLook}
        title={strings.compare.looksHelp}
        aria-label={strings.compare.withLook}
        data-test="compare-look"
      >
        {strings.compare.looks}
      </button>
      <button
        type="button"
        onClick={() => input.current?.click()}
        aria-label={strings.compare.withMesh}
        data-test="compare-mesh"
      >
        {strings.compare.mesh}
      </button>
      <input
        ref={input}
        type="file"
        multiple
        hidden
        data-test="compare-input"
        onChange={(e) => {
          const files = filesOfInput(e.currentTarget.files!);
          e.currentTarget.value = "";
          if (files.length > 0) void compareFiles(files);
        }}
      />
    </div>
  );
}

function CompareTools({ compared }: { compared: Compared }) {
  return (
    <div class="group compare-menu">
      <button
        type="button"
        aria-pressed={heat.value}
        onClick={() => (heat.value = !heat.value)}
        aria-label={strings.compare.heat}
        title={strings.compare.heat}
        data-test="heat-toggle"
      >
        {strings.compare.heatShort}
      </button>
      {!compared.mesh && (
        <button
          type="button"
          data-test="compare-use"
          onClick={() => {
            applyLook("compare", compared.look);
            endCompare();
          }}
        >
          {strings.compare.keep}
        </button>
      )}
      <button type="button" onClick={endCompare} data-test="compare-end">
        {strings.compare.stop}
      </button>
    </div>
  );
}
