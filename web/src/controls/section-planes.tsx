import { hold } from "../picture/live";
import { endStep } from "../state/history";
import type { Value } from "../state/look";
import { strings } from "../strings";
import type { Edit } from "./field";

const AXES = ["x", "y", "z"] as const;

interface Plane {
  axis: string;
  share: number;
}

/** The first cut of `scene.section`, which is a list of `{"axis": "x", "at": "40%"}`. */
export function planeOf(value: Value | undefined): Plane | null {
  const first = Array.isArray(value) ? value[0] : null;
  if (!first || typeof first !== "object" || Array.isArray(first)) return null;
  const share = Number.parseFloat(String(first["at"]));
  return { axis: String(first["axis"]), share: Number.isFinite(share) ? share : 50 };
}

/** One cut through the mesh: an axis and how far along it. */
export function SectionPlanes({ edit, id }: { edit: Edit; id: string }) {
  const plane = planeOf(edit.value);
  const put = (axis: string, share: number) => edit.set([{ axis, at: `${share}%` }]);
  return (
    <div class="section-planes">
      <div class="segments" role="group" aria-labelledby={`${id}-label`}>
        {AXES.map((axis) => (
          <button
            type="button"
            class="segment"
            key={axis}
            aria-pressed={plane?.axis === axis}
            data-test={`choice-${id}-${axis}`}
            onClick={() => {
              endStep();
              if (plane?.axis === axis) edit.set(undefined);
              else put(axis, plane?.share ?? 50);
            }}
          >
            {axis}
          </button>
        ))}
      </div>
      {plane && (
        <input
          type="range"
          id={id}
          min={0}
          max={100}
          step={1}
          value={plane.share}
          aria-label={strings.controls.slider(id)}
          onPointerDown={() => {
            endStep();
            hold(true);
          }}
          onPointerUp={() => hold(false)}
          onPointerCancel={() => hold(false)}
          onChange={() => hold(false)}
          onInput={(e) => put(plane.axis, Number(e.currentTarget.value))}
        />
      )}
    </div>
  );
}
