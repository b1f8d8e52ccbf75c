import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import test from "node:test";
import { load } from "./bundle.mjs";

const { lineOf, KINDS, shell, attribute, markdown, literal } = await load("copy/lines.ts", "copy/quote.ts");

const picture = {
  mesh: { sha256: "a".repeat(64), name: "it's <b>.obj", entry: "x y.obj", formatIn: null, files: null },
  look: { keys: { "style": "wire", "wire.color": "#f00" }, materials: {} },
  size: { width: 640, height: 480 },
  format: "webp",
};
const line = (kind, keyed = false) => lineOf(kind, picture, { keyed, limit: 4096 });
const url = `https://meshes.example/tools/mesh/v1/meshes/${"a".repeat(64)}/render.webp?entry=x%20y.obj&style=wire&wire.color=%23f00&size=640x480`;

test("addresses have the page's origin and prefix", () => {
  assert.equal(line("url"), url);
  assert.equal(line("signed"), `meshsnap sign '${url}' --expires 1d`);
  assert.ok(line("markdown").endsWith(`](${url})`));
});

test("a shell reads the words as they were", () => {
  for (const word of ["plain", "it's", '$HOME `x` "q" \\', "a\nb", ""]) {
    assert.equal(execFileSync("/bin/sh", ["-c", `printf %s ${shell(word)}`]).toString(), word);
  }
});

test("the command line draws the file", () => {
  assert.equal(
    line("command"),
    `meshsnap render 'it'\\''s <b>.obj' -o 'it_s _b_.webp' --style wire --set 'wire.color=#f00' --size 640x480`,
  );
});

test("keys are named, never written", () => {
  for (const kind of ["curl", "python", "javascript"]) assert.match(line(kind, true), /MESHSNAP_KEY/);
});

test("the document names the mesh, the size and the format", () => {
  const { mesh, image, wire } = JSON.parse(line("json"));
  assert.equal(mesh, picture.mesh.sha256);
  assert.deepEqual(image, { width: 640, height: 480, format: "webp" });
  assert.deepEqual(wire, { color: "#f00" });
});

test("an image has a second size only as far as the server draws it", () => {
  assert.match(line("srcset"), / 2x"/);
  assert.doesNotMatch(lineOf("srcset", picture, { keyed: false, limit: 1000 }), / 2x"/);
});

test("quotes hold", () => {
  assert.equal(attribute('a"<b>&'), '"a&quot;&lt;b&gt;&amp;"');
  assert.equal(markdown("a]*b"), "a\\]\\*b");
  assert.equal(JSON.parse(literal('é"\u2028')), 'é"\u2028');
  assert.equal(KINDS.length, 9);
});
