// The pictures of docs/page.md: the page while somebody uses it. docs/page.sh runs this.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { bySelector, choose, file, newPage, run, serve, settled } from "../../tests/node/page/lib.mjs";

const example = (name) => readFileSync(new URL(`../../api/examples/${name}`, import.meta.url), "utf8");

/** The knot, with a hole. */
function torn() {
  const lines = example("knot.obj").split("\n");
  const first = lines.findIndex((line) => line.startsWith("f "));
  return lines.filter((_, i) => i < first + 1500 || i >= first + 1508).join("\n");
}

/** A page with a mesh. */
async function opened(name, text, options = {}) {
  const { url } = await serve();
  const page = await newPage({ viewport: { width: 1280, height: 800 }, ...options });
  await page.goto(url);
  await choose(page, file(name, text));
  await settled(page);
  return { page, url };
}

/** Turns the picture by dragging it. */
async function turn(page, dx, dy) {
  const box = await page.locator(bySelector("stage")).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + dx, y + dy, { steps: 8 });
  await page.mouse.up();
  await settled(page);
}

/** Finds a setting by its key, and fills it in. */
async function set(page, key, value) {
  await page.fill(bySelector("search"), key);
  await page.fill(`${bySelector(`field-${key}`)} input[type=text]`, value);
  await page.keyboard.press("Enter");
}

async function shot(page, name) {
  await page.waitForLoadState("networkidle");
  const path = new URL(`${name}.png`, import.meta.url).pathname;
  await page.screenshot({ path });
}

await run({
  "a mesh is turned": async () => {
    const { page } = await opened("knot.obj", example("knot.obj"));
    await turn(page, 90, 60);
    await shot(page, "turn");
  },

  "red lines over clay": async () => {
    const { page } = await opened("knot.obj", example("knot.obj"));
    await page.click(bySelector("style-clay"));
    await page.fill(bySelector("search"), "wire");
    await page.click(bySelector("layer-wire-on"));
    await set(page, "wire.color", "#e02020");
    await set(page, "wire.thickness", "2");
    await page.fill(bySelector("search"), "wire");
    const address = await settled(page);
    assert.match(address, /wire\.color=%23e02020/);
    await page.click(bySelector("copy-curl"));
    await shot(page, "lines");
  },

  "the edges of a hole": async () => {
    const { page } = await opened("torn.obj", torn());
    await page.click(bySelector("tab-report"));
    await page.locator('[data-test^="fault-watertight"]').first().click();
    await settled(page);
    await shot(page, "report");
  },

  "two looks beside each other": async () => {
    const { page } = await opened("knot.obj", example("knot.obj"));
    await page.click(bySelector("compare-look"));
    await page.click(bySelector("style-technical"));
    await page.waitForSelector(bySelector("divider"));
    await page.waitForTimeout(2000);
    await shot(page, "compare");
  },

  "a phone in the dark": async () => {
    const { page } = await opened("lamp.obj", example("lamp.obj"), { colorScheme: "dark" });
    const before = await page.getAttribute(bySelector("picture"), "data-finished");
    await page.setViewportSize({ width: 390, height: 844 });
    await page.waitForSelector(`${bySelector("picture")}:not([data-finished="${before}"])[data-draft="false"]`);
    await shot(page, "phone");
  },

  "the status": async () => {
    const { page, url } = await opened("knot.obj", example("knot.obj"));
    await fetch(`${url}v1/render`, { method: "POST", body: "no mesh" });
    await fetch(`${url}v1/render?sise=1`, { method: "POST", body: example("lamp.obj") });
    await page.goto(`${url}status`);
    await page.waitForSelector("text=unknown_key");
    await shot(page, "status");
  },
});
