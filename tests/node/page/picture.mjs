// The page at `/`: a mesh that is dropped, its picture while it is turned, styles, and tabs beside each other.

import assert from "node:assert/strict";
import { bySelector, checkedAddress, CUBE, drop, newPage, run, serve, settled, until } from "./lib.mjs";

async function opened() {
  const { url } = await serve();
  const page = await newPage();
  await page.goto(url);
  await drop(page, ["cube.obj", CUBE]);
  await settled(page);
  return page;
}

/** Drags from the middle of the picture, by steps. */
async function drag(page, dx, dy, steps = 6) {
  const box = await page.locator(bySelector("stage")).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + dx, y + dy, { steps });
  await page.mouse.up();
}

const azimuth = (address) => Number(new URL(address).searchParams.get("camera.azimuth_deg"));

await run({
  "a mesh that is dropped is shown as its address gives it": async () => {
    const { url } = await serve();
    const page = await newPage();
    const asked = [];
    page.on("request", (request) => asked.push(request.url()));
    await page.goto(url);
    await page.waitForSelector(bySelector("empty"));
    assert.ok(asked.every((address) => address.startsWith(url) || address.startsWith("data:")), `${asked}`);
    await drop(page, ["cube.obj", CUBE]);
    const address = await checkedAddress(page);
    assert.match(address, new RegExp(`^${url}v1/meshes/[0-9a-f]{64}/render\\.webp\\?`));
    assert.equal(await page.textContent(bySelector("mesh-name")), "cube.obj");
  },

  // Time of the processor, which is the same on a busy machine.
  "the page takes input after less than a second of work": async () => {
    const { url } = await serve();
    const page = await newPage();
    const devtools = await page.context().newCDPSession(page);
    await devtools.send("Performance.enable", { timeDomain: "threadTicks" });
    await page.goto(url);
    await page.waitForSelector(bySelector("choose-files"));
    const { metrics } = await devtools.send("Performance.getMetrics");
    const seconds = metrics.find(({ name }) => name === "TaskDuration").value;
    assert.ok(seconds > 0 && seconds < 1, `${seconds} s`);
    const navigation = await page.evaluate(() => performance.getEntriesByType("navigation")[0].toJSON());
    console.log(`${Math.round(seconds * 1000)} ms of work, interactive after ${Math.round(navigation.domInteractive)} ms`);
  },

  "the picture after a drag is that of the last angle": async () => {
    const page = await opened();
    const before = await checkedAddress(page);
    await drag(page, 120, -40);
    const after = await checkedAddress(page);
    assert.notEqual(azimuth(after), azimuth(before));
    await page.dblclick(bySelector("stage"));
    await checkedAddress(page);
  },

  "a picture that comes late does not replace a newer one": async () => {
    const page = await opened();
    // The first picture that is asked for from here on comes after all others.
    let release;
    const held = new Promise((done) => (release = done));
    let count = 0;
    await page.route(/render\.webp.*azimuth/, async (route) => {
      if (count++ === 0) await held;
      await route.continue().catch(() => undefined);
    });
    await page.focus(bySelector("stage"));
    await page.keyboard.press("ArrowLeft");
    await until(page, () => document.querySelector('[data-test="stage"]').ariaBusy === "true");
    await drag(page, 60, 20);
    for (let i = 0; i < 3; i++) await page.keyboard.press("ArrowLeft");
    release();
    await checkedAddress(page);
    assert.ok(count > 1, `${count} pictures were asked for`);
  },

  "each style is shown": async () => {
    const page = await opened();
    const { styles } = await (await fetch(new URL("v1/capabilities", page.url()))).json();
    assert.ok(styles.length >= 12, `${styles}`);
    for (const style of styles) {
      await page.click(bySelector(`style-${style}`));
      const address = await checkedAddress(page);
      assert.equal(new URL(address).searchParams.get("style") ?? "auto", style);
    }
    // Each has a thumbnail of this mesh.
    await until(page, () => [...document.querySelectorAll(".thumbnails button")].every((one) => one.querySelector("img")));
  },

  "two tabs do not disturb each other, and a link shows the same": async () => {
    const one = await opened();
    await one.click(bySelector("style-wire"));
    const first = await checkedAddress(one);
    // The address bar follows once the look rests.
    await until(one, () => location.hash.includes("style=wire"));
    const two = await newPage({ beside: one });
    await two.goto(one.url());
    assert.equal(await checkedAddress(two), first);
    await two.click(bySelector("style-clay"));
    const second = await checkedAddress(two);
    assert.match(second, /style=clay/);
    await one.bringToFront();
    assert.equal(await checkedAddress(one), first);
  },
});
