import { signal, useSignalEffect } from "@preact/signals";
import { postJson } from "../api/client";
import type { Verdict } from "../api/types";
import { flyTo } from "../camera/move";
import type { Vec } from "../camera/vector";
import { queryOf } from "../state/look";
import { capabilities, mesh, readingPairs, type OpenMesh } from "../state/mesh";
import { endStep } from "../state/history";
import { announcement } from "../state/phase";
import { strings } from "../strings";

type Check = Verdict["checks"][number];

const STANDARD =
  "watertight,manifold,consistent-winding,no-degenerate,no-duplicate-faces,no-loose-vertices,no-inverted-volume";
const FAULTS_SHOWN = 20;
/** More buttons than these are of no use to anyone. */
const MOST_SHOWN = 2000;

const words = strings.report;
const rules = signal(STANDARD);
const verdict = signal<{ of: OpenMesh; checks: Check[] } | { of: OpenMesh; failed: string } | null>(null);
/** The fault that the camera looks at. */
const current = signal<string | null>(null);

/** Rules whose faults are all shown. */
const unfolded = signal<ReadonlySet<string>>(new Set());

/** Shows all faults of a rule, once the server has told where they are. */
async function unfold(of: OpenMesh, rule: string): Promise<void> {
  try {
    const query = queryOf([...readingPairs(of), ["rules", rules.peek()], ["places", "all"]]);
    const { checks } = await postJson<Verdict>(`v1/check?${query}`, { mesh: of.sha256 });
    if (verdict.peek()?.of !== of) return;
    verdict.value = { of, checks };
    unfolded.value = new Set([...unfolded.peek(), rule]);
  } catch (error) {
    announcement.value = error instanceof Error ? error.message : String(error);
  }
}

async function check(of: OpenMesh): Promise<void> {
  unfolded.value = new Set();
  try {
    const query = queryOf([...readingPairs(of), ["rules", rules.peek()]]);
    const { checks } = await postJson<Verdict>(`v1/check?${query}`, { mesh: of.sha256 });
    if (mesh.peek() === of) verdict.value = { of, checks };
  } catch (error) {
    if (mesh.peek() === of) verdict.value = { of, failed: error instanceof Error ? error.message : String(error) };
  }
}

/** The verdict of rules about how the mesh hangs together, and the places of its faults. */
export function Checks() {
  useSignalEffect(() => {
    const open = mesh.value;
    if (open && verdict.peek()?.of !== open) void check(open);
  });
  return (
    <>
      <Verdicts />
      <Rules />
    </>
  );
}

function Verdicts() {
  const found = verdict.value;
  if (!found || found.of !== mesh.value) return <p class="quiet">{words.checking}</p>;
  if ("failed" in found)
    return (
      <p class="refusal-text" role="alert">
        {found.failed}
      </p>
    );
  const anyPlaces = found.checks.some(({ where }) => where.length > 0);
  return (
    <>
      {anyPlaces && <p class="quiet">{words.faults}</p>}
      <ul class="checks">
        {found.checks.map((one) => (
          <CheckItem key={one.rule} check={one} />
        ))}
      </ul>
    </>
  );
}

/** The rules that are checked, to be changed. */
function Rules() {
  const known = capabilities.value?.check_rules ?? [];
  const change = (text: string) => {
    rules.value = text.replace(/\s+/g, "") || STANDARD;
    verdict.value = null;
    if (mesh.value) void check(mesh.value);
  };
  return (
    <details class="rules">
      <summary>{words.rules}</summary>
      <textarea
        rows={3}
        aria-label={words.rules}
        spellcheck={false}
        value={rules.value.replaceAll(",", ", ")}
        onChange={(e) => change(e.currentTarget.value)}
        data-test="rules"
      />
      <p class="quiet">{words.knownRules(known)}</p>
    </details>
  );
}

function CheckItem({ check: { rule, ok, level, detail, where, found } }: { check: Check }) {
  const state = ok ? "passed" : level === "warn" ? "warned" : "failed";
  const places = where.slice(0, unfolded.value.has(rule) ? MOST_SHOWN : FAULTS_SHOWN);
  const rest = Math.max(where.length, typeof found === "number" ? found : 0) - places.length;
  const open = mesh.value;
  return (
    <li class={`check is-${state}`} data-test={`check-${rule}`}>
      <span class="verdict">{words[state]}</span> <strong>{rule}</strong>
      {!ok && <p>{detail}</p>}
      {where.length > 0 && (
        <div class="faults">
          {places.map((place, i) => (
            <Fault key={i} id={`${rule}-${i}`} number={i + 1} place={place} />
          ))}
          {rest > 0 &&
            (unfolded.value.has(rule) || !open ? (
              <span class="quiet">{words.moreFaults(rest)}</span>
            ) : (
              <button type="button" class="link" data-test={`more-${rule}`} onClick={() => void unfold(open, rule)}>
                {words.moreFaults(rest)}
              </button>
            ))}
        </div>
      )}
    </li>
  );
}

function Fault({ id, number, place }: { id: string; number: number; place: object }) {
  const [kind, points] = pointsOf(place);
  const fly = () => {
    endStep();
    current.value = id;
    flyTo(points);
  };
  return (
    <button
      type="button"
      class="fault"
      aria-pressed={current.value === id}
      data-test={`fault-${id}`}
      title={points.map((p) => `(${p.join(", ")})`).join(" ")}
      aria-label={`${words.fault(number)}: ${kind}`}
      onClick={fly}
    >
      {number}
    </button>
  );
}

function pointsOf(place: object): [string, Vec[]] {
  const { edge, face, vertex } = place as { edge?: Vec[]; face?: Vec[]; vertex?: Vec };
  if (edge) return [words.kinds.edge, edge];
  if (face) return [words.kinds.face, face];
  return vertex ? [words.kinds.vertex, [vertex]] : [words.kinds.fault, []];
}
