// The settings of the page at `/`: the control of each key changes this key in the picture's address.

import assert from "node:assert/strict";
import { bySelector, checkedAddress, choose, CUBE, file, newPage, PATIENCE_MS, run, serve, settled, until } from "./lib.mjs";

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

/**
 * Uses the control of each key, in the page, and takes the key back by its arrow. The answer names the keys without a
 * control, and those whose control does nothing.
 */
async function useAll(keys, patienceMs) {
  const named = (name) => document.querySelector(`[data-test="${name}"]`);
  const set = (input, value, type) => {
    input.value = value;
    input.dispatchEvent(new Event(type, { bubbles: true }));
  };
  const becomes = async (condition) => {
    for (const began = performance.now(); performance.now() - began < patienceMs; ) {
      if (condition()) return true;
      await new Promise(requestAnimationFrame);
    }
    return false;
  };
  /** Sets a control to a value that is not its default. */
  const change = (row) => {
    const box = row.querySelector("input[type=checkbox]");
    if (box) return box.click();
    const select = row.querySelector("select");
    const isOther = ({ value }) => value !== "" && !select.options[0].textContent.includes(value);
    if (select) return set(select, [...select.options].find(isOther).value, "change");
    const segment = [...row.querySelectorAll(".segment")].find((one) => one.ariaPressed !== "true");
    if (segment) return segment.click();
    const text = row.querySelector("input[type=text]");
    const swatch = [...row.querySelectorAll(".swatch")].find((one) => one.title !== text.value);
    if (swatch) return swatch.click();
    const range = row.querySelector("input[type=range]");
    if (range) return set(range, range.value === range.max ? range.min : range.max, "input");
    set(text, text.placeholder.includes("x, y, z") ? "1, 2, 3" : "3", "change");
  };
  const [missing, idle] = [[], []];
  const holds = (key) => new URL(named("copy-text").textContent).searchParams.has(key);
  for (const key of keys) {
    set(named("search"), key, "input");
    if (!(await becomes(() => named(`field-${key}`)))) {
      missing.push(key);
      continue;
    }
    change(named(`field-${key}`));
    if (!(await becomes(() => holds(key)))) idle.push(key);
    named(`reset-${key}`)?.click();
    if (!(await becomes(() => !holds(key)))) idle.push(`reset of ${key}`);
  }
  return { missing, idle };
}

await run({
  "the control of each key changes the key in the address, and its arrow takes it back": async () => {
    const page = await opened();
    const keys = await keysOf(page);
    assert.ok(keys.length > 50, `${keys.length} keys`);
    // Small pictures: the server draws one for each change.
    await page.selectOption(bySelector("size"), "256");
    const found = await page.evaluate(`(${useAll})(${JSON.stringify(keys)}, ${PATIENCE_MS})`);
    assert.deepEqual(found, { missing: [], idle: [] });
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
