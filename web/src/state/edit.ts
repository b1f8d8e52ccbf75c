import { change, endStep, look } from "./history";
import { EMPTY, isView, type Keys, type Look, type Value } from "./look";

/** Sets a key; `undefined` resets it. */
export function setKey(key: string, value: Value | undefined): void {
  setKeys(key, { [key]: value });
}

/** Sets several keys in one step. */
export function setKeys(what: string, values: Record<string, Value | undefined>): void {
  change(what, { ...look.value, keys: merge(look.value.keys, values) });
}

/** Sets a key of one material. */
export function setMaterialKey(material: string, key: string, value: Value | undefined): void {
  const own = merge(look.value.materials[material] ?? {}, { [key]: value });
  const materials = { ...look.value.materials, [material]: own };
  if (Object.keys(own).length === 0) delete (materials as Record<string, Keys>)[material];
  change(`material ${material} ${key}`, { ...look.value, materials });
}

/** Shows another look from the same direction. */
export function applyLook(what: string, next: Look): void {
  const view = Object.entries(look.value.keys).filter(([key]) => isView(key));
  endStep();
  change(what, { keys: { ...next.keys, ...Object.fromEntries(view) }, materials: next.materials });
}

/** Chooses a style, and keeps all other keys. */
export function setStyle(style: string): void {
  endStep();
  setKey("style", style === "auto" ? undefined : style);
}

export function resetAll(): void {
  endStep();
  change("reset", EMPTY);
}

function merge(keys: Keys, values: Record<string, Value | undefined>): Keys {
  const out: Record<string, Value> = { ...keys };
  for (const [key, value] of Object.entries(values)) {
    if (value === undefined) delete out[key];
    else out[key] = value;
  }
  return out;
}
