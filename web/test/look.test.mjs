import assert from "node:assert/strict";
import test from "node:test";
import { load } from "./bundle.mjs";

const { pairsOf, allPairsOf, documentOf, effective, encode, lookOf, scaledLook } = await load(
  "state/look.ts",
  "state/link.ts",
  "state/scaled.ts",
);
const look = (keys, materials = {}) => ({ keys, materials });
const plain = (value) => JSON.parse(JSON.stringify(value));

test("a look comes back from its pairs", () => {
  const all = look(
    {
      "style": "wire",
      "outline": null,
      "wire.color": "#f00",
      "wire.thickness": 2.5,
      "wire.lit": true,
      "camera.eye": [1, -2.5, 3e-7],
      "sheet.views": ["front", "top"],
      "surface.color": "000",
    },
    { Glass: { "surface.opacity": 0.3, "outline": null } },
  );
  assert.deepEqual(plain(lookOf(allPairsOf(all))), plain(all));
});

test("materials whose names have dots go as one JSON value, and come back", () => {
  const all = look({}, { "a.b<c>": { "surface.opacity": 0.5 }, "Glass": { outline: null } });
  assert.deepEqual(
    pairsOf(all).map(([key]) => key),
    ["materials"],
  );
  assert.deepEqual(plain(lookOf(pairsOf(all))), all);
});

test("names of prototypes in an address are names like any other", () => {
  lookOf([
    ["materials.__proto__.surface.opacity", "1"],
    ["__proto__", '{"a":1}'],
  ]);
  assert.equal({}["surface.opacity"], undefined);
  assert.equal({}.a, undefined);
});

test("keys that the server refuses beside others are left out", () => {
  const keys = { "camera.azimuth_deg": 5, "sheet.labels": true, "camera.projection": "orthographic" };
  assert.deepEqual(effective(look(keys)).keys, { "sheet.labels": true, "camera.projection": "orthographic" });
  const turning = {
    "camera.azimuth_deg": 5,
    "sheet.turntable": 4,
    "camera.eye": [1, 2, 3],
    "camera.target": [0, 0, 0],
  };
  assert.deepEqual(effective(look(turning)).keys, { "camera.azimuth_deg": 5, "sheet.turntable": 4 });
  assert.deepEqual(effective(look({ "wire": null, "wire.color": "#f00" })).keys, { wire: null });
  assert.deepEqual(effective(look({ "wire": {}, "wire.color": "#f00" })).keys, { "wire.color": "#f00" });
});

test("a document has sections", () => {
  const all = look(
    { "style": "wire", "wire.color": "#f00", "wire.thickness": 2 },
    { Glass: { "surface.opacity": 0.3 } },
  );
  assert.deepEqual(documentOf(all), {
    style: "wire",
    wire: { color: "#f00", thickness: 2 },
    materials: { Glass: { surface: { opacity: 0.3 } } },
  });
});

test("a query stays readable, and has nothing that a shell, HTML or Markdown takes for its own", () => {
  assert.equal(encode("1,2,3"), "1,2,3");
  assert.equal(encode("#f00"), "%23f00");
  assert.doesNotMatch(encode(`'"<>()&$\`\\ !*;|`), /['"<>()&$`\\ !*;|]/);
});

test("widths in pixels shrink with the picture, others do not", () => {
  const keys = { "wire.thickness": 4, "outline.thickness": 0.5, "image.samples": 4 };
  assert.deepEqual(scaledLook(look(keys), 0.5).keys, {
    "wire.thickness": 2,
    "outline.thickness": 0.5,
    "image.samples": 4,
  });
  const px = { "outline.unit": "px", "outline.thickness": 4, "wire.method": "fwidth", "wire.thickness": 4 };
  assert.deepEqual(scaledLook(look(px), 0.5).keys, { ...px, "outline.thickness": 2 });
});
