import { look } from "../state/history";
import { report } from "../state/mesh";
import type { Field } from "./schema";

/**
 * Ranges of sliders where the range of the key is much wider than what is of use. The box beside a
 * slider takes the whole range.
 */
const USEFUL: Record<string, [number, number]> = {
  azimuth_deg: [-180, 180],
  fov_deg: [5, 120],
  thickness: [0, 8],
  min_length: [0, 100],
  smoothing: [0, 4],
  intensity: [0, 4],
  size_px: [0.5, 16],
  max_error: [0.1, 10],
  max_time_ms: [5, 1000],
  time_s: [0, 10],
  columns: [1, 8],
  turntable: [2, 36],
  quality: [1, 100],
};

const WIDE = 1000;

export interface Range {
  min: number;
  max: number;
  step: number;
}

/** The slider's range; null where none makes sense. */
export function rangeOf(field: Field): Range | null {
  if (field.key === "outline.thickness" && look.value.keys["outline.unit"] !== "px") return inModelUnits();
  const useful = USEFUL[field.name];
  const [min, max] = useful ?? [field.min, field.max];
  if (min === null || max === null || (!useful && max - min > WIDE)) return null;
  return { min: Math.max(min, field.min ?? min), max: Math.min(max, field.max ?? max), step: stepOf(field, max - min) };
}

/** The value that the key takes and that is nearest to one that was typed. */
export function kept({ min, max, whole }: Field, value: number): number {
  return Math.min(max ?? Infinity, Math.max(min ?? -Infinity, whole ? Math.round(value) : value));
}

/** Thicknesses in model units: up to a twentieth of the mesh. */
function inModelUnits(): Range | null {
  const size = (report.value?.bounds as { size?: number[] } | null | undefined)?.size;
  const longest = Math.max(0, ...(size ?? []));
  if (longest === 0) return null;
  const step = 10 ** Math.floor(Math.log10(longest / 500));
  return { min: 0, max: Number((longest / 20).toPrecision(2)), step };
}

function stepOf(field: Field, wide: number): number {
  if (field.whole) return 1;
  if (wide >= 90) return 1;
  return wide > 5 ? 0.1 : 0.01;
}

const UNITS: [RegExp, string][] = [
  [/_deg$/, "°"],
  [/_px$/, "px"],
  [/_ms$/, "ms"],
  [/_s$/, "s"],
];

/** Name of a key for people, and its unit. */
export function labelOf(name: string): { label: string; unit: string } {
  const found = UNITS.find(([ending]) => ending.test(name));
  const bare = found ? name.replace(found[0], "") : name;
  return { label: bare.replaceAll("_", " "), unit: found?.[1] ?? "" };
}

/** Name of a key's control, as in "Color". */
export function controlName(key: string): string {
  const { label } = labelOf(key.split(".").at(-1) ?? key);
  return label.charAt(0).toUpperCase() + label.slice(1);
}
