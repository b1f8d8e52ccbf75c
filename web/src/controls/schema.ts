/** The parts of JSON Schema that /v1/schema uses. */
export interface Schema {
  $ref?: string;
  $defs?: Record<string, Schema>;
  type?: string | string[];
  properties?: Record<string, Schema>;
  additionalProperties?: boolean | Schema;
  items?: Schema;
  anyOf?: Schema[];
  enum?: (string | number | null)[];
  const?: string | number;
  pattern?: string;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  minItems?: number;
  maxItems?: number;
  default?: unknown;
  description?: string;
}

export type Kind = "choice" | "number" | "boolean" | "colour" | "background" | "vector" | "list" | "text" | "json";

/** A control: one key of the request. */
export interface Field {
  key: string;
  section: string;
  name: string;
  kind: Kind;
  description: string;
  default: unknown;
  /** Words that stand in place of a number, or all values of a choice. */
  words: (string | number)[];
  min: number | null;
  max: number | null;
  whole: boolean;
  nullable: boolean;
}

export interface Section {
  name: string;
  description: string;
  /** True for layers that null turns off. */
  layer: boolean;
  fields: Field[];
}

/** Keys that the page has controls of its own for, or that only a body can have. */
const OWN = new Set(["$schema", "mesh", "materials", "style", "image.width", "image.height", "image.format"]);

/** Sections whose presence draws something. */
const LAYERS = new Set(["surface", "wire", "outline", "topology", "sheet"]);

/** Makes the sections of controls of a schema. Short names are left out: they stand for other keys. */
export function sectionsOf(root: Schema): Section[] {
  const general: Section = { name: "", description: "", layer: false, fields: [] };
  const sections: Section[] = [];
  for (const [name, stated] of Object.entries(root.properties ?? {})) {
    const schema = resolve(root, stated);
    if (OWN.has(name) || (schema.description ?? "").startsWith("Short for")) continue;
    if (schema.properties) sections.push(sectionOf(root, name, schema));
    else general.fields.push(fieldOf("", name, schema));
  }
  const order = ["wire", "outline", "surface", "topology", "light", "camera", "scene", "image", "sheet", "points"];
  const rank = ({ name }: Section) => (order.indexOf(name) + order.length + 1) % (order.length + 1);
  sections.sort((a, b) => rank(a) - rank(b));
  return general.fields.length > 0 ? [...sections, general] : sections;
}

function sectionOf(root: Schema, name: string, schema: Schema): Section {
  const fields = Object.entries(schema.properties ?? {})
    .filter(([key]) => !OWN.has(`${name}.${key}`))
    .map(([key, stated]) => fieldOf(name, key, resolve(root, stated)));
  return { name, description: schema.description ?? "", layer: LAYERS.has(name), fields };
}

/** Sections that a single material may have. */
export function materialSectionsOf(root: Schema): Section[] {
  const materials = resolve(root, root.properties?.["materials"] ?? {});
  const own = typeof materials.additionalProperties === "object" ? resolve(root, materials.additionalProperties) : {};
  return Object.entries(own.properties ?? {}).map(([name, stated]) => sectionOf(root, name, resolve(root, stated)));
}

function resolve(root: Schema, schema: Schema): Schema {
  const name = schema.$ref?.split("/").at(-1);
  return name ? { ...root.$defs?.[name], ...schema } : schema;
}

function fieldOf(section: string, name: string, schema: Schema): Field {
  const numeric = schema.anyOf?.find((one) => one.minimum !== undefined || one.type === "number") ?? schema;
  const words = [...(schema.enum ?? []), ...(schema.anyOf ?? []).flatMap((one) => one.enum ?? one.const ?? [])];
  const types = [schema.type ?? (schema.anyOf ?? []).map((one) => one.type ?? [])].flat(2);
  return {
    key: section ? `${section}.${name}` : name,
    section,
    name,
    kind: kindOf(schema, types),
    description: schema.description ?? "",
    default: schema.default,
    words: (schema.items?.enum ?? words).filter((word): word is string | number => word !== null),
    min: numeric.minimum ?? numeric.exclusiveMinimum ?? null,
    max: numeric.maximum ?? null,
    whole: types.includes("integer") && !types.includes("number"),
    nullable: types.includes("null") && schema.default === null,
  };
}

function kindOf(schema: Schema, types: string[]): Kind {
  if (schema.enum || schema.anyOf?.some((one) => one.enum)) return "choice";
  if (types.includes("boolean")) return "boolean";
  if (types.includes("array")) return kindOfList(schema);
  if (schema.pattern?.includes("0-9a-fA-F")) return schema.pattern.includes("\\.\\.") ? "background" : "colour";
  if (types.includes("number") || types.includes("integer")) return "number";
  return types.includes("object") ? "json" : "text";
}

function kindOfList({ items, minItems, maxItems }: Schema): Kind {
  if (items?.enum) return "list";
  return minItems === 3 && maxItems === 3 ? "vector" : "json";
}
