// The lines to copy, executed: each gives the picture that is shown, to the byte.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readdirSync, readFileSync, symlinkSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { bySelector, bytesAt, choose, copyText, CUBE, file, folder, newPage, run, serve, settled, shownBytes, until } from "./lib.mjs";

/** A name that needs quoting everywhere. */
const NAME = "it's a \"cube\".obj";
const KEY = "key-of-the-test";

/** A folder with the mesh, and with the program under test on the path. */
function desk() {
  const path = folder();
  symlinkSync(process.env.MESHSNAP_TEST_PROGRAM, join(path, "meshsnap"));
  writeFileSync(join(path, NAME), CUBE);
  const env = { PATH: `${path}:${process.env.PATH}`, HOME: "/nonexistent", MESHSNAP_EPHEMERAL: "true", MESHSNAP_KEY: KEY };
  const execute = (program, words, input) => execFileSync(program, words, { cwd: path, env, input, stdio: ["pipe", "pipe", "pipe"] });
  return { path, execute };
}

/** A page with a look that has quotes, colours and materials in its lines. */
async function opened({ keys } = {}) {
  const { url } = await serve([], { keys });
  const page = await newPage();
  await page.goto(url);
  if (keys) {
    await page.fill(bySelector("key"), keys);
    await page.click(bySelector("key-use"));
  }
  await choose(page, file(NAME, CUBE));
  await settled(page);
  await page.click(bySelector("style-wire"));
  for (const [key, value] of [["wire.color", "#e02020"], ["image.background", "#fff..#dde"]]) {
    await page.fill(bySelector("search"), key);
    await page.fill(`${bySelector(`field-${key}`)} input[type=text]`, value);
    await page.keyboard.press("Enter");
  }
  // The same back-end everywhere: a machine may have a GPU, which the server of this test does not use.
  await page.fill(bySelector("search"), "backend");
  await page.click(bySelector("choice-backend-cpu"));
  await page.selectOption(bySelector("size"), "256");
  await page.selectOption(bySelector("format"), "png");
  const address = await settled(page);
  for (const part of ["wire.color=%23e02020", "backend=cpu", "size=256", "render.png"]) assert.ok(address.includes(part), address);
  return { page, url, address, shown: await shownBytes(page) };
}

const is = (bytes, shown, what) => assert.ok(Buffer.compare(bytes, shown) === 0, `${what}: ${bytes.length} bytes, ${shown.length} are shown`);

/** The one picture that a line has written. */
function written({ path }) {
  const pictures = readdirSync(path).filter((name) => name.endsWith(".png"));
  assert.equal(pictures.length, 1, `${pictures}`);
  return readFileSync(join(path, pictures[0]));
}

async function check({ page, url, shown }, key) {
  const line = (kind) => copyText(page, kind);
  let at = desk();
  at.execute("sh", ["-c", await line("curl")]);
  is(written(at), shown, "curl");
  at = desk();
  at.execute("sh", ["-c", await line("command")]);
  is(written(at), shown, "command line");
  at = desk();
  at.execute("python3", ["-"], await line("python"));
  is(written(at), shown, "Python");
  const store = 'import { writeFileSync } from "node:fs";\nwriteFileSync("out", Buffer.from(await picture.arrayBuffer()));\n';
  writeFileSync(join(at.path, "line.mjs"), `${await line("javascript")}\n${store}`);
  at.execute(process.execPath, ["line.mjs"]);
  is(readFileSync(join(at.path, "out")), shown, "JavaScript");
  const headers = { "Content-Type": "application/json", ...(key && { Authorization: `Bearer ${key}` }) };
  const answer = await fetch(`${url}v1/render`, { method: "POST", headers, body: await line("json") });
  is(Buffer.from(await answer.arrayBuffer()), shown, "JSON");
}

await run({
  "each line gives the bytes that are shown": async () => {
    const made = await opened();
    await check(made);
    is(await bytesAt(made.address), made.shown, "address");
    // HTML, read by a browser.
    const html = await copyText(made.page, "srcset");
    const parsed = await made.page.evaluate((text) => {
      const image = new DOMParser().parseFromString(text, "text/html").querySelector("img");
      return { src: image.src, srcset: image.srcset, alt: image.alt, width: image.width };
    }, html);
    is(await bytesAt(parsed.src), made.shown, "img");
    assert.ok(parsed.srcset.startsWith(`${made.address} 1x`) && parsed.width === 256, html);
    const markdown = await copyText(made.page, "markdown");
    is(await bytesAt(/\]\((.*)\)$/.exec(markdown)[1]), made.shown, "Markdown");
  },

  "with keys, lines send the key of a variable, and a signed address needs none": async () => {
    const made = await opened({ keys: KEY });
    await check(made, KEY);
    for (const kind of ["curl", "python", "javascript"]) {
      const text = await copyText(made.page, kind);
      assert.ok(text.includes("MESHSNAP_KEY") && !text.includes(KEY), text);
    }
    assert.equal((await fetch(made.address)).status, 401);
    await made.page.click(bySelector("copy-signed"));
    await until(made.page, () => document.querySelector('[data-test="copy-text"]').textContent.includes("sig="));
    is(await bytesAt(await made.page.textContent(bySelector("copy-text"))), made.shown, "signed address");
  },
});
