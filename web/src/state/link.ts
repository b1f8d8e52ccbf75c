import { effect } from "@preact/signals";
import { base } from "../api/base";
import { wanted } from "../picture/live";
import { allPairsOf, EMPTY, type Keys, type Look, queryOf, type Value } from "./look";
import { look } from "./history";
import { mesh, type OpenMesh } from "./mesh";
import { chosenSize, type Format, format, readSize, type Size, sizeText } from "./size";
import { compare, type Compared } from "../compare/state";

/** All that a link to the page holds. */
interface Linked {
  mesh: OpenMesh;
  look: Look;
  size: Size | null;
  format: Format;
  compare: Compared | null;
}

const OWN = new Set(["mesh", "name", "entry", "format_in", "size", "as", "beside"]);

/** The fragment that brings back what is shown. */
export function fragment(): string {
  const open = mesh.value;
  if (!open) return "";
  const pairs: [string, string][] = [
    ["mesh", open.sha256],
    ["name", open.name],
  ];
  if (open.entry !== null) pairs.push(["entry", open.entry]);
  if (open.formatIn !== null) pairs.push(["format_in", open.formatIn]);
  pairs.push(...allPairsOf(look.value));
  if (chosenSize.value) pairs.push(["size", sizeText(chosenSize.value)]);
  if (format.value !== "webp") pairs.push(["as", format.value]);
  if (compare.value)
    pairs.push(["beside", JSON.stringify({ ...compare.value, mesh: withoutFiles(compare.value.mesh) })]);
  return `#${queryOf(pairs)}`;
}

const withoutFiles = (open: OpenMesh | null): OpenMesh | null => open && { ...open, files: null };

export function shareLink(): string {
  return base + fragment();
}

/** Reads a fragment; null if it names no mesh. */
export function readFragment(text: string): Linked | null {
  const pairs = [...new URLSearchParams(text.replace(/^#/, ""))];
  const get = (name: string) => pairs.find(([key]) => key === name)?.[1] ?? null;
  const sha256 = get("mesh");
  if (!sha256 || !/^[0-9a-f]{64}$/.test(sha256)) return null;
  const name = (get("name") ?? sha256.slice(0, 12)).slice(0, 300);
  const as = get("as");
  return {
    mesh: { sha256, name, entry: get("entry"), formatIn: get("format_in"), files: null },
    look: lookOf(pairs.filter(([key]) => !OWN.has(key))),
    size: readSize(get("size") ?? ""),
    format: as === "png" || as === "jpeg" ? as : "webp",
    compare: readCompared(get("beside")),
  };
}

function readCompared(text: string | null): Compared | null {
  try {
    const read = JSON.parse(text ?? "null") as Compared | null;
    const isObject = (value: unknown) => value !== null && typeof value === "object" && !Array.isArray(value);
    if (!read || !isObject(read.look?.keys) || !isObject(read.look.materials)) return null;
    if (!Object.values(read.look.materials).every(isObject)) return null;
    if (read.mesh && !/^[0-9a-f]{64}$/.test(read.mesh.sha256)) return null;
    return read;
  } catch {
    return null;
  }
}

/** The look of pairs. Values are read as JSON where they are numbers, words of JSON, or lists. */
export function lookOf(pairs: [string, string][]): Look {
  // Without a prototype, because the names are those of an address: `__proto__` is a name like any other.
  const keys = Object.create(null) as Record<string, Value>;
  const materials = Object.create(null) as Record<string, Record<string, Value>>;
  for (const [key, text] of pairs) {
    if (key === "materials") Object.assign(materials, flatMaterials(text));
    const named = /^materials\.([^.]+)\.(.+)$/.exec(key);
    if (named) (materials[named[1]!] ??= Object.create(null) as Record<string, Value>)[named[2]!] = valueOf(text);
    else if (key !== "materials") keys[key] = valueOf(text);
  }
  return { ...EMPTY, keys, materials };
}

function valueOf(text: string): Value {
  if (/^-?(0|[1-9]\d*)(\.\d+)?(e[-+]?\d+)?$/i.test(text) || /^(true|false|null)$/.test(text))
    return JSON.parse(text) as Value;
  if (/^[[{]/.test(text)) {
    try {
      return JSON.parse(text) as Value;
    } catch {
      return text;
    }
  }
  const parts = text.split(",");
  if (parts.length > 1) return parts.map((part) => valueOf(part));
  return text;
}

function flatMaterials(text: string): Record<string, Record<string, Value>> {
  const nested = valueOf(text);
  if (nested === null || typeof nested !== "object" || Array.isArray(nested)) return {};
  return Object.fromEntries(Object.entries(nested).map(([name, own]) => [name, flat(own)]));
}

function flat(own: Value): Record<string, Value> {
  const out: Record<string, Value> = {};
  if (own === null || typeof own !== "object" || Array.isArray(own)) return out;
  for (const [section, value] of Object.entries(own)) {
    if (value === null || typeof value !== "object" || Array.isArray(value)) out[section] = value;
    else for (const [key, inner] of Object.entries(value as Keys)) out[`${section}.${key}`] = inner;
  }
  return out;
}

/** Keeps the address bar up to date, so that a reload brings back the same. */
export function startLink(): void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  effect(() => {
    clearTimeout(timer);
    if (!wanted.value) return;
    const text = fragment();
    timer = setTimeout(() => history.replaceState(null, "", location.pathname + location.search + text), 250);
  });
}
