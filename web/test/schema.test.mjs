import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { load } from "./bundle.mjs";

const { sectionsOf, materialSectionsOf, rangeOf } = await load("controls/schema.ts", "controls/ranges.ts");
const schema = JSON.parse(readFileSync(new URL("../../api/material.schema.json", import.meta.url), "utf8"));
const fields = sectionsOf(schema).flatMap((section) => section.fields);

/** Keys of the schema with dots. */
function keysOf(root) {
  const resolve = (one) => (one.$ref ? root.$defs[one.$ref.split("/").at(-1)] : one);
  return Object.entries(root.properties).flatMap(([name, stated]) => {
    const one = resolve(stated);
    return one.properties ? Object.keys(one.properties).map((key) => `${name}.${key}`) : [name];
  });
}

test("each key has a control, apart from short names and what the page has elsewhere", () => {
  const elsewhere = ["$schema", "style", "materials", "mesh", "image.width", "image.height", "image.format"];
  const short = Object.entries(schema.properties).filter(([, one]) => one.description?.startsWith("Short for"));
  const left = new Set([...elsewhere, ...short.map(([name]) => name)]);
  assert.deepEqual(
    fields.map(({ key }) => key).sort(),
    keysOf(schema)
      .filter((key) => !left.has(key))
      .sort(),
  );
});

test("no control falls back to plain text", () => {
  assert.deepEqual(
    fields.filter(({ kind }) => kind === "text" || kind === "json").map(({ key }) => key),
    [],
  );
});

test("sliders lie in the ranges of their keys", () => {
  for (const field of fields) {
    const range = field.kind === "number" ? rangeOf(field) : null;
    if (!range) continue;
    assert.ok(range.min >= (field.min ?? range.min) && range.max <= (field.max ?? range.max), field.key);
    assert.ok(range.step > 0 && range.max > range.min, field.key);
  }
});

test("materials have the layers that the schema gives them", () => {
  assert.deepEqual(
    materialSectionsOf(schema)
      .map(({ name }) => name)
      .sort(),
    ["outline", "surface", "wire"],
  );
});
