import assert from "node:assert/strict";
import test from "node:test";
import { load } from "./bundle.mjs";

globalThis.Image = class {
  decode() {
    return Promise.resolve();
  }
};
URL.createObjectURL = () => "blob:1";
URL.revokeObjectURL = () => {};

const { PictureLoop } = await load("picture/loop.ts");
const picture = (style) => ({
  mesh: { sha256: "a".repeat(64), name: "a.obj", entry: null, formatIn: null, files: null },
  look: { keys: { style }, materials: {} },
  size: { width: 8, height: 8 },
  format: "webp",
});

/** A loop in front of a server that answers when the test says so. */
function bench() {
  const seen = { shown: [], refused: [], asked: 0, atOnce: 0, most: 0 };
  const open = [];
  globalThis.fetch = (_url, { signal }) => {
    seen.asked++;
    seen.most = Math.max(seen.most, ++seen.atOnce);
    return new Promise((done, fail) => {
      open.push(done);
      signal.addEventListener("abort", () => fail(new DOMException("ended", "AbortError")));
    }).finally(() => seen.atOnce--);
  };
  const loop = new PictureLoop({
    shown: ({ picture, draft }) => seen.shown.push(`${picture.look.keys.style}${draft ? " draft" : ""}`),
    refused: (refusal) => seen.refused.push(refusal.key),
    busy() {},
  });
  const answer = async (response = new Response(new Blob(["x"]))) => {
    open.pop()?.(response);
    await settled();
  };
  return { loop, seen, answer };
}

/** Lets all that follows from what has happened happen. */
async function settled() {
  for (let i = 0; i < 20; i++) await new Promise((done) => setImmediate(done));
}

async function until(isTrue) {
  while (!isTrue()) await new Promise((done) => setTimeout(done, 1));
}

test("one picture is under way, and the newest order is the last that is shown", async () => {
  const { loop, seen, answer } = bench();
  loop.want(picture("d0"), true);
  for (let i = 1; i < 10; i++) loop.want(picture(`d${i}`), true);
  await answer();
  assert.deepEqual(seen.shown, ["d0 draft"]);
  await answer();
  assert.deepEqual(seen.shown, ["d0 draft", "d9 draft"]);
  loop.want(picture("d10"), true);
  loop.want(picture("end"), false);
  await settled();
  await answer();
  assert.deepEqual(seen.shown, ["d0 draft", "d9 draft", "end"]);
  assert.deepEqual([seen.most, seen.atOnce], [1, 0]);
});

test("a picture of full size is ended when something newer is asked for", async () => {
  const { loop, seen, answer } = bench();
  loop.want(picture("old"), false);
  loop.want(picture("new"), false);
  await settled();
  await answer();
  assert.deepEqual(seen.shown, ["new"]);
  assert.equal(seen.most, 1);
});

test("a draft comes before a picture that takes long, unless something newer does", async () => {
  const { loop, seen, answer } = bench();
  loop.wantBoth(picture("a"), picture("a"));
  await answer();
  await answer();
  assert.deepEqual(seen.shown, ["a draft", "a"]);
  loop.wantBoth(picture("b"), picture("b"));
  loop.want(picture("c"), false);
  await settled();
  await answer();
  await answer();
  assert.deepEqual(seen.shown, ["a draft", "a", "c"]);
});

test("a busy server is asked again after the time that it states", async () => {
  const { loop, seen, answer } = bench();
  loop.want(picture("a"), false);
  await answer(new Response('{"status":429,"detail":"busy"}', { status: 429, headers: { "retry-after": "0" } }));
  await until(() => seen.asked === 2);
  await answer();
  assert.deepEqual(seen.shown, ["a"]);
});

test("a refusal names its key, and is not asked again", async () => {
  const { loop, seen, answer } = bench();
  loop.want(picture("a"), false);
  await answer(new Response('{"status":400,"detail":"`wire.color` is \\"x\\""}', { status: 400 }));
  assert.deepEqual([seen.refused, seen.asked], [["wire.color"], 1]);
});
