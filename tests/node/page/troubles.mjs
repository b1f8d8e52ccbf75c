// What the page at `/` shows when something goes wrong: the server's own words, a form for a key, a wait.

import assert from "node:assert/strict";
import { bySelector, checkedAddress, choose, CUBE, drop, file, newPage, run, serve, settled, until } from "./lib.mjs";
import { proxy } from "./proxy.mjs";

async function opened(server) {
  const page = await newPage();
  await page.goto(server.url);
  await choose(page, file("cube.obj", CUBE));
  await checkedAddress(page);
  return page;
}

const isShown = (page, name) => page.waitForSelector(bySelector(name));
const isGone = (page, name) => page.waitForSelector(bySelector(name), { state: "detached" });

await run({
  "a file that is no mesh is refused in the server's words": async () => {
    const { url } = await serve();
    const page = await newPage();
    await page.goto(url);
    const answer = page.waitForResponse((one) => one.url().endsWith("/v1/meshes"));
    await drop(page, ["notes.txt", "no mesh at all"]);
    const { detail, code } = await (await answer).json();
    const shown = await isShown(page, "refusal");
    assert.equal(await shown.textContent(), detail);
    assert.equal(await shown.getAttribute("data-code"), code);
    await choose(page, file("cube.obj", CUBE));
    await checkedAddress(page);
  },

  "a refused setting is marked, and the last picture stays": async () => {
    const page = await opened(await serve());
    await page.fill(bySelector("search"), "wire.color");
    await page.fill(`${bySelector("field-wire.color")} input[type=text]`, "no-colour");
    const answer = page.waitForResponse((one) => one.url().includes("color=no-colour") && one.status() === 400);
    await page.keyboard.press("Enter");
    const { detail } = await (await answer).json();
    assert.ok((await (await isShown(page, "picture-refusal")).textContent()).includes(detail));
    await until(page, () => document.querySelector('[data-test="field-wire.color"]').classList.contains("is-refused"));
    assert.ok(await page.isVisible(bySelector("picture")));
    assert.ok(await page.isDisabled(bySelector("copy")));
    await page.click(bySelector("undo"));
    await isGone(page, "picture-refusal");
    await checkedAddress(page);
  },

  "numbers are kept in their range, and names of colours become digits": async () => {
    const page = await opened(await serve());
    for (const [key, typed, taken] of [["wire.opacity", "2", "1"], ["wire.color", "red", "#ff0000"]]) {
      await page.fill(bySelector("search"), key);
      await page.fill(`${bySelector(`field-${key}`)} input[type=text]`, typed);
      await page.keyboard.press("Enter");
      const address = new URL(await checkedAddress(page));
      assert.equal(address.searchParams.get(key), taken);
    }
  },

  "a key is asked for, and a wrong one is said to be wrong": async () => {
    const { url } = await serve([], { keys: "right" });
    const page = await newPage();
    await page.goto(url);
    await isShown(page, "key-form");
    await page.fill(bySelector("key"), "wrong");
    await page.click(bySelector("key-use"));
    await isShown(page, "key-wrong");
    await page.fill(bySelector("key"), "right");
    await page.click(bySelector("key-use"));
    await isGone(page, "key-form");
    await choose(page, file("cube.obj", CUBE));
    await checkedAddress(page, "right");
    // The key is kept for the tab, and nowhere where another tab finds it.
    await until(page, () => location.hash.includes("mesh="));
    await page.reload();
    await checkedAddress(page, "right");
    const other = await newPage({ beside: page });
    await other.goto(url);
    await isShown(other, "key-form");
    assert.ok(!page.url().includes("right"));
  },

  "a mesh that is too large is refused before it is sent": async () => {
    const { url } = await serve(["--limit-body-bytes", "1000"]);
    const page = await newPage();
    const sent = [];
    page.on("request", (request) => request.method() === "POST" && sent.push(request.url()));
    await page.goto(url);
    // What the page knows of formats and limits has come.
    await until(page, () => /3MF/i.test(document.querySelector('[data-test="empty"]')?.textContent));
    await choose(page, file("large.obj", CUBE.repeat(10)));
    await isShown(page, "refusal");
    assert.deepEqual(sent, []);
    await choose(page, file("cube.obj", CUBE));
    await checkedAddress(page);
    assert.equal(sent.length, 1);
  },

  "a server that is asked too often is asked again after its Retry-After": async () => {
    const { url } = await serve(["--rate-per-s", "1", "--rate-burst", "2"]);
    const page = await newPage();
    const busy = [];
    page.on("response", (one) => one.status() === 429 && busy.push(one.headers()["retry-after"]));
    await page.goto(url);
    await choose(page, file("cube.obj", CUBE));
    // Sending the mesh uses the rate up, or else turning it does.
    for (let i = 0; busy.length === 0; i++) {
      assert.ok(i < 500, "no request was refused");
      await page.focus(bySelector("stage"));
      await page.keyboard.press(i % 2 ? "ArrowLeft" : "ArrowUp");
      await isShown(page, "picture");
    }
    assert.ok(busy.every((seconds) => Number(seconds) >= 1), `${busy}`);
    const address = await settled(page);
    assert.match(address, /azimuth_deg|elevation_deg|render/);
    await isGone(page, "waiting");
  },

  "a server that is gone is said to be gone, and its picture comes when it is back": async () => {
    const front = await proxy((await serve()).port);
    const page = await opened(front);
    front.state.target = null;
    await page.click(bySelector("style-wire"));
    await isShown(page, "gone");
    // Another server has no memory of the mesh, so the page sends it again.
    front.state.target = (await serve()).port;
    await isGone(page, "gone");
    const address = await checkedAddress(page);
    assert.match(address, /style=wire/);
    front.close();
  },
});
