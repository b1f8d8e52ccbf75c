// Pictures per second on the page while a mesh is turned by dragging, in Chromium.
//
//     node tests/bench/page.mjs bunny.obj        # with target/release/meshsnap; tests/run installs playwright-core
//
// A picture counts when the page shows it. Browser and server share the machine.

import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { basename } from "node:path";

const [path, seconds = "4"] = process.argv.slice(2);
if (!path) throw new Error("name a mesh: node tests/bench/page.mjs bunny.obj");
const root = new URL("../../", import.meta.url).pathname;
process.env.MESHSNAP_TEST_PROGRAM ??= `${root}target/release/meshsnap`;
process.env.MESHSNAP_TEST_TOOLS ??= `${root}target/node`;
process.env.MESHSNAP_TEST_BROWSER ??= execFileSync("sh", ["-c", "command -v chromium || command -v google-chrome"], { encoding: "utf8" }).trim();
const { bySelector, choose, file, newPage, run, serve, settled } = await import("../node/page/lib.mjs");

/** Drags the picture around for a while; the number of pictures that were shown in a second. */
async function dragged(page) {
  await page.evaluate((picture) => {
    window.shown = 0;
    window.observer ??= new MutationObserver(() => window.shown++);
    window.observer.observe(document.querySelector(picture), { attributes: true, attributeFilter: ["src"] });
  }, bySelector("picture"));
  const box = await page.locator(bySelector("stage")).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  const began = performance.now();
  const elapsed = () => (performance.now() - began) / 1000;
  for (let i = 0; elapsed() < Number(seconds); i++) {
    await page.mouse.move(x + 200 * Math.sin(i / 20), y + 40 * Math.sin(i / 31));
    await new Promise((go) => setTimeout(go, 10));
  }
  const rate = (await page.evaluate(() => window.shown)) / elapsed();
  await page.mouse.up();
  await settled(page);
  return rate;
}

await run({
  "pictures per second": async () => {
    const { url } = await serve();
    const page = await newPage({ viewport: { width: 1280, height: 800 } });
    await page.goto(url);
    await choose(page, file(basename(path), readFileSync(path)));
    await settled(page);
    const rates = [];
    for (let round = 0; round < 5; round++) rates.push(await dragged(page));
    console.log(`${rates.map((rate) => rate.toFixed(1)).join(", ")} pictures per second`);
  },
});
