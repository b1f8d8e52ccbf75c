import type { Keys, Look, Value } from "./look";

const WIDTHS = ["wire.thickness", "outline.thickness", "topology.thickness", "points.size_px"];
const LENGTHS = ["wire.min_length", "outline.min_length"];
const LEAST_PX: Record<string, number> = { "points.size_px": 0.5 };

/** A look for a smaller picture: what is measured in pixels shrinks with it. */
export function scaledLook(look: Look, share: number): Look {
  if (share >= 1) return look;
  const materials = Object.entries(look.materials).map(([name, own]): [string, Keys] => [
    name,
    scaledKeys(own, share, { ...look.keys, ...own }),
  ]);
  return { keys: scaledKeys(look.keys, share, look.keys), materials: Object.fromEntries(materials) };
}

function scaledKeys(keys: Keys, share: number, all: Keys): Keys {
  const out: Record<string, Value> = { ...keys };
  for (const key of [...WIDTHS, ...LENGTHS]) {
    const value = out[key];
    if (typeof value !== "number" || !isInPixels(key, all)) continue;
    out[key] = Number(Math.max(LEAST_PX[key] ?? 0, value * share).toPrecision(3));
  }
  return out;
}

function isInPixels(key: string, all: Keys): boolean {
  if (key === "wire.thickness") return (all["wire.method"] ?? "exact") === "exact";
  return key !== "outline.thickness" || all["outline.unit"] === "px";
}
