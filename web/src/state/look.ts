/** A value of a request key. */
export type Value = null | boolean | number | string | Value[] | { [name: string]: Value };

/** Request keys with dots, as in a query: `wire.color`. */
export type Keys = Readonly<Record<string, Value>>;

/** What the picture looks like: the keys that are set, and those of single materials by name. */
export interface Look {
  readonly keys: Keys;
  readonly materials: Readonly<Record<string, Keys>>;
}

export const EMPTY: Look = { keys: {}, materials: {} };

const ANGLES = ["camera.azimuth_deg", "camera.elevation_deg"];
const PLACED = ["camera.eye", "camera.target"];

/** True for keys that place the camera, which a look that is applied does not touch. */
export function isView(key: string): boolean {
  return /^camera\.(view|azimuth_deg|elevation_deg|eye|target|height|from_file)$/.test(key);
}

/** True if the picture has a cell for each of several named views, whose angles are their own. */
export function hasNamedViews(keys: Keys): boolean {
  const { present, turntable } = sheetOf(keys);
  return present && turntable === null;
}

function sheetOf(keys: Keys): { present: boolean; turntable: Value } {
  if (keys["sheet"] === null) return { present: false, turntable: null };
  const present = Object.keys(keys).some((key) => key === "sheet" || key.startsWith("sheet."));
  return { present, turntable: keys["sheet.turntable"] ?? null };
}

/** Leaves out keys that the server refuses beside others, so that they come back with these. */
export function effective(look: Look): Look {
  const out: Record<string, Value> = { ...look.keys };
  const drop = (names: string[]) => names.forEach((name) => delete out[name]);
  const { present, turntable } = sheetOf(look.keys);
  if (present && turntable === null) drop([...ANGLES, ...PLACED, "camera.from_file"]);
  else if (present) drop([...PLACED, "camera.from_file", "sheet.views"]);
  if (out["camera.from_file"] === true) drop([...ANGLES, ...PLACED, "camera.height"]);
  for (const [key, value] of Object.entries(look.keys)) {
    if (!key.includes(".") && value === null) dropBelow(out, key);
    if (!key.includes(".") && value !== null && typeof value === "object" && hasBelow(out, key)) delete out[key];
  }
  return { keys: out, materials: look.materials };
}

function dropBelow(keys: Record<string, Value>, section: string): void {
  for (const key of Object.keys(keys)) if (key.startsWith(`${section}.`)) delete keys[key];
}

function hasBelow(keys: Keys, section: string): boolean {
  return Object.keys(keys).some((key) => key.startsWith(`${section}.`));
}

/** A value as text of a query. */
export function textOf(value: Value): string {
  if (Array.isArray(value) && value.every((v) => typeof v !== "object")) return value.join(",");
  if (value !== null && typeof value === "object") return JSON.stringify(value);
  return String(value);
}

/** Percent-encodes text for a query, and leaves what need not be encoded readable. */
export function encode(text: string): string {
  const plain = encodeURIComponent(text).replace(/%2C/g, ",").replace(/%2F/g, "/").replace(/%3A/g, ":");
  return plain.replace(/['()*!]/g, (c) => `%${c.charCodeAt(0).toString(16).toUpperCase()}`);
}

/** The look as pairs of a query that the server takes. */
export function pairsOf(look: Look): [string, string][] {
  return allPairsOf(effective(look));
}

/** All of the look as pairs. Materials whose names have dots go as one JSON value. */
export function allPairsOf({ keys, materials }: Look): [string, string][] {
  const pairs = Object.entries(keys).map(([key, value]): [string, string] => [key, textOf(value)]);
  const named = Object.entries(materials).filter(([, own]) => Object.keys(own).length > 0);
  if (named.length === 0) return pairs;
  if (named.every(([name]) => /^[^.{}[\]"]+$/.test(name))) {
    for (const [name, own] of named) {
      for (const [key, value] of Object.entries(own)) pairs.push([`materials.${name}.${key}`, textOf(value)]);
    }
    return pairs;
  }
  const nested = Object.fromEntries(named.map(([name, own]) => [name, nest(own)]));
  return [...pairs, ["materials", JSON.stringify(nested)]];
}

export function queryOf(pairs: [string, string][]): string {
  return pairs.map(([key, value]) => `${encode(key)}=${encode(value)}`).join("&");
}

/** Keys with dots as a document with sections. */
export function nest(keys: Keys): { [name: string]: Value } {
  const out: { [name: string]: Value } = {};
  for (const [key, value] of Object.entries(keys)) {
    const [section, name] = split(key);
    if (name === null) out[section] = value;
    else out[section] = { ...(out[section] as object), [name]: value };
  }
  return out;
}

function split(key: string): [string, string | null] {
  const dot = key.indexOf(".");
  return dot < 0 ? [key, null] : [key.slice(0, dot), key.slice(dot + 1)];
}

/** The look as a request document. */
export function documentOf(look: Look): { [name: string]: Value } {
  const { keys, materials } = effective(look);
  const document = nest(keys);
  const named = Object.entries(materials).filter(([, own]) => Object.keys(own).length > 0);
  if (named.length > 0) document["materials"] = Object.fromEntries(named.map(([name, own]) => [name, nest(own)]));
  return document;
}
