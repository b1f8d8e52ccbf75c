// The page beside pictures of it that somebody has looked at, at three widths. They are compared at an eighth of their
// size: fonts differ from machine to machine, and what is wrong with a layout is large.
//
// MESHSNAP_TEST_BLESS=1 takes them anew. Look at each before it is kept.

import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { bySelector, choose, file, newPage, run, serve, until } from "./lib.mjs";

const KNOT = readFileSync(new URL("../../../api/examples/knot.obj", import.meta.url));
const GOLDEN = new URL("pictures/", import.meta.url);

/** Mean and largest difference of two pictures' cells of 8 x 8 pixels, of 255. */
async function difference(golden, found) {
  const page = await newPage();
  const sources = [golden, found].map((bytes) => `data:image/png;base64,${bytes.toString("base64")}`);
  return page.evaluate(async (sources) => {
    const [a, b] = await Promise.all(
      sources.map(async (source) => {
        const image = await createImageBitmap(await (await fetch(source)).blob());
        const canvas = new OffscreenCanvas(image.width, image.height);
        const context = canvas.getContext("2d");
        context.drawImage(image, 0, 0);
        return context.getImageData(0, 0, image.width, image.height);
      }),
    );
    if (a.width !== b.width || a.height !== b.height) return { size: [a.width, a.height, b.width, b.height] };
    let [sum, largest, cells] = [0, 0, 0];
    for (let y = 0; y + 8 <= a.height; y += 8) {
      for (let x = 0; x + 8 <= a.width; x += 8) {
        let [of_a, of_b] = [0, 0];
        for (let i = 0; i < 64; i++) {
          const at = 4 * ((y + (i >> 3)) * a.width + x + (i & 7));
          of_a += a.data[at] + a.data[at + 1] + a.data[at + 2];
          of_b += b.data[at] + b.data[at + 1] + b.data[at + 2];
        }
        const cell = Math.abs(of_a - of_b) / 192;
        [sum, largest, cells] = [sum + cell, Math.max(largest, cell), cells + 1];
      }
    }
    return { mean: sum / cells, largest };
  }, sources);
}

/** The page with the knot, as it looks when all has arrived. */
async function shot(width, height, colorScheme) {
  const { url } = await serve();
  const page = await newPage({ viewport: { width, height }, colorScheme });
  await page.goto(url);
  await choose(page, file("knot.obj", KNOT));
  await page.waitForSelector(`${bySelector("picture")}[data-draft="false"]`);
  await until(page, () => {
    const isSeen = (element) => element.getClientRects().length > 0 && element.getBoundingClientRect().top < innerHeight;
    const looks = [...document.querySelectorAll('[data-test^="style-"], [data-test^="preset-"]')].filter(isSeen);
    const arrived = (image) => image?.complete && image.naturalWidth > 0;
    const isIdle = !document.querySelector('[aria-busy="true"]');
    return isIdle && looks.every((look) => arrived(look.querySelector("img"))) && [...document.images].filter(isSeen).every(arrived);
  });
  return page.screenshot({ animations: "disabled", caret: "hide" });
}

const looksAsBefore = (name, ...of) => async () => {
  const [found, path] = [await shot(...of), new URL(`${name}.png`, GOLDEN)];
  if (process.env.MESHSNAP_TEST_BLESS) {
    mkdirSync(GOLDEN, { recursive: true });
    writeFileSync(path, found);
  }
  assert.ok(existsSync(path), `${name}.png is missing`);
  const { mean, largest, size } = await difference(readFileSync(path), found);
  assert.equal(size, undefined, "sizes");
  assert.ok(mean < 5 && largest < 220, `${name}: cells differ by ${mean} on average and by ${largest} at most`);
  console.log(`${name}: ${mean.toFixed(2)} on average, ${largest.toFixed(0)} at most`);
};

await run({
  "a desk": looksAsBefore("desk", 1440, 900, "light"),
  "a tablet in the dark": looksAsBefore("tablet", 900, 1100, "dark"),
  "a phone": looksAsBefore("phone", 390, 844, "light"),
});
