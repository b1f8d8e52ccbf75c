// Both pages, looked at by axe-core at two widths, light and dark, in all their states.

import assert from "node:assert/strict";
import { axeSource, bySelector, choose, CUBE, file, keyFlags, newPage, run, serve } from "./lib.mjs";

/** Faults that axe finds, with what it has looked at. */
async function look(page, at) {
  const found = await page.evaluate(async (source) => {
    if (!window.axe) (0, eval)(source);
    const result = await window.axe.run(document, { resultTypes: ["violations"] });
    const nodes = (one) => one.nodes.slice(0, 3).map((node) => `${node.html.slice(0, 160)} ${node.failureSummary}`);
    return {
      violations: result.violations.map((one) => [one.id, ...nodes(one)]),
      passes: result.passes.length,
      overflow: document.documentElement.scrollWidth - innerWidth,
    };
  }, axeSource());
  assert.deepEqual(found.violations, [], at);
  assert.ok(found.passes > 10, `${at}: only ${found.passes} rules`);
  assert.ok(found.overflow <= 0, `${at}: ${found.overflow} px beyond the window`);
}

const VIEWS = [[390, 844, "dark"], [1280, 800, "light"]];

const cases = {};
for (const [width, height, colorScheme] of VIEWS) {
  const at = `${width} px, ${colorScheme}`;
  // bypassCSP: axe is put into the page, which the policy rightly forbids.
  const options = { viewport: { width, height }, colorScheme, bypassCSP: true };
  cases[`the page at /, ${at}`] = async () => {
    const { url } = await serve();
    const page = await newPage(options);
    await page.goto(url);
    await page.waitForSelector(bySelector("empty"));
    await look(page, `empty, ${at}`);
    await choose(page, file("no.txt", "no mesh"));
    await page.waitForSelector(bySelector("refusal"));
    await look(page, `refused, ${at}`);
    await choose(page, file("cube.obj", CUBE));
    await page.waitForSelector(bySelector("stage"));
    for (const tab of await page.locator("[role=tab]:visible").all()) {
      await tab.click();
      await look(page, `${await tab.textContent()}, ${at}`);
    }
  };
  cases[`the page at /status and the form for a key, ${at}`] = async () => {
    const { url } = await serve(keyFlags({ right: ["admin"] }));
    const page = await newPage(options);
    await page.goto(url);
    await page.waitForSelector(bySelector("key-form"));
    await look(page, `key, ${at}`);
    await page.goto(`${url}status`);
    await page.waitForSelector(bySelector("key-form"));
    await look(page, `key of status, ${at}`);
    await page.fill(bySelector("key"), "right");
    await page.click(bySelector("key-use"));
    await page.waitForSelector(bySelector("tiles"));
    await look(page, `status, ${at}`);
  };
}
await run(cases);
