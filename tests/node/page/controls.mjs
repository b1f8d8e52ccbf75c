// The settings of the page at `/`: the control of each key changes this key in the picture's address.

import assert from "node:assert/strict";
import { bySelector, checkedAddress, choose, CUBE, file, newPage, run, serve, settled, until } from "./lib.mjs";

/** Keys that have controls elsewhere on the page, or none in an address. */
const OTHER = new Set(["$schema", "mesh", "style", "image.width", "image.height", "image.format"]);

async function opened() {
  const { url } = await serve();
  const page = await newPage();
  await page.goto(url);
  await choose(page, file("cube.obj", CUBE));
  await settled(page);
  return page;
}

/** Names of all keys that a request of a stored mesh can have, from the server's schema, without short names. */
async function keysOf(page) {
  const schema = await (await fetch(new URL("v1/schema", page.url()))).json();
  const resolved = (one) => (one.$ref ? { ...schema.$defs?.[one.$ref.split("/").at(-1)], ...one } : one);
  const keys = [];
  for (const [name, stated] of Object.entries(schema.properties)) {
    const one = resolved(stated);
    if (name === "materials" || (one.description ?? "").startsWith("Short for")) continue;
    if (one.properties) keys.push(...Object.keys(one.properties).map((inner) => `${name}.${inner}`));
    else keys.push(name);
  }
  return keys.filter((key) => !OTHER.has(key));
}

/** Sets a control to a value that is not its default: runs in the page. */
function change(row) {
  const set = (input, value) => {
    input.value = value;
    input.dispatchEvent(new Event(input.type === "range" || input.type === "color" ? "input" : "change", { bubbles: true }));
  };
  const box = row.querySelector("input[type=checkbox]");
  if (box) return box.click();
  const select = row.querySelector("select");
  if (select) {
    const other = [...select.options].find((one) => one.value !== "" && !select.options[0].textContent.includes(one.value));
    return set(select, other.value);
  }
  const segment = [...row.querySelectorAll(".segment")].find((one) => one.ariaPressed !== "true");
  if (segment) return segment.click();
  const swatch = [...row.querySelectorAll(".swatch")].find((one) => one.title !== row.querySelector("input[type=text]").value);
  if (swatch) return swatch.click();
  const range = row.querySelector("input[type=range]");
  if (range) return set(range, range.value === range.max ? range.min : range.max);
  const text = row.querySelector("input[type=text]");
  return set(text, text.placeholder.includes("x, y, z") ? "1, 2, 3" : /^-?[\d.]+$/.test(text.value) ? String(Number(text.value) + 1) : "3");
}

await run({
  "the control of each key changes the key in the address, and its arrow takes it back": async () => {
    const page = await opened();
    const keys = await keysOf(page);
    assert.ok(keys.length > 50, `${keys.length} keys`);
    const missing = [];
    for (const key of keys) {
      await page.fill(bySelector("search"), key);
      const row = page.locator(bySelector(`field-${key}`));
      if ((await row.count()) === 0) {
        missing.push(key);
        continue;
      }
      await row.evaluate(change);
      const holds = (name) => new URL(document.querySelector('[data-test="copy-text"]').textContent).searchParams.has(name);
      await until(page, holds, key).catch(() => assert.fail(`the control of ${key} does not change the address`));
      await page.click(bySelector(`reset-${key}`));
      await until(page, (name) => !new URL(document.querySelector('[data-test="copy-text"]').textContent).searchParams.has(name), key);
    }
    assert.deepEqual(missing, [], "keys without a control");
  },

  "undo, redo and reset bring looks back": async () => {
    const page = await opened();
    const plain = await checkedAddress(page);
    await page.click(bySelector("style-wire"));
    const wire = await settled(page);
    await page.click(bySelector("style-xray"));
    const xray = await settled(page);
    await page.click(bySelector("undo"));
    assert.equal(await settled(page), wire);
    await page.click(bySelector("undo"));
    assert.equal(await settled(page), plain);
    await page.click(bySelector("redo"));
    await page.click(bySelector("redo"));
    assert.equal(await checkedAddress(page), xray);
    await page.click(bySelector("reset-all"));
    assert.ok(!new URL(await settled(page)).searchParams.has("style"));
  },

  "a material has layers of its own": async () => {
    const page = await opened();
    await page.click(bySelector("tab-materials"));
    await page.click(bySelector("material-Glass"));
    await page.click(`${bySelector("section-materials.Glass.surface")} summary`);
    await page.fill(`${bySelector("field-materials.Glass.surface.opacity")} input[type=text]`, "0.25");
    await page.keyboard.press("Enter");
    await until(page, () => document.querySelector('[data-test="copy-text"]').textContent.includes("materials.Glass.surface.opacity=0.25"));
    await checkedAddress(page);
  },
});
