// Shared parts of the tests of the pages: a server, a browser, files to open, and waits for conditions.
//
// A script gets its tools from the environment: MESHSNAP_TEST_PROGRAM (the program under test), MESHSNAP_TEST_BROWSER
// (Chromium) and MESHSNAP_TEST_TOOLS (the folder with node_modules).

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const { MESHSNAP_TEST_PROGRAM: program, MESHSNAP_TEST_BROWSER: executablePath, MESHSNAP_TEST_TOOLS: tools } = process.env;
const require = createRequire(join(tools, "node_modules/"));
const { chromium } = require("playwright-core");

/** A guard against hanging: nothing that a test waits for takes longer, even on a busy machine. */
export const PATIENCE_MS = Number(process.env.MESHSNAP_TEST_PATIENCE_MS ?? 60_000);

export const axeSource = () => readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");

/** A cube of quads with two materials. */
export const CUBE = `v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
usemtl Clay\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nusemtl Glass\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n`;

export const bySelector = (name) => `[data-test="${name}"]`;

const children = new Set();
const folders = [];
let browser;

/** Starts the program under test as a server on a free port. It ends with the case. */
export async function serve(flags = [], { keys } = {}) {
  const words = ["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", ...flags];
  const env = { PATH: process.env.PATH, MESHSNAP_EPHEMERAL: "true", HOME: "/nonexistent", ...(keys && { MESHSNAP_API_KEYS: keys }) };
  const child = spawn(program, words, { env, stdio: ["ignore", "pipe", "ignore"] });
  children.add(child);
  const url = await new Promise((found, fail) => {
    let said = "";
    child.stdout.on("data", (part) => {
      const line = /^listening on (http:\S+)$/m.exec((said += part));
      if (line) found(`${line[1]}/`);
    });
    child.on("exit", (code) => fail(new Error(`the server ended with ${code}: ${said}`)));
  });
  return { url, port: Number(new URL(url).port) };
}

/** Flags of a server with these keys, each with its scopes. */
export function keyFlags(scopesOf) {
  const path = join(folder(), "keys.toml");
  const table = ([key, scopes]) => {
    const sha256 = createHash("sha256").update(key).digest("hex");
    return `[[keys]]\nname = "${key}"\nsha256 = "${sha256}"\nscopes = ${JSON.stringify(scopes)}\n`;
  };
  writeFileSync(path, Object.entries(scopesOf).map(table).join(""));
  return ["--api-keys-file", path];
}

/** A page in a context of its own, or in that of `beside`. Faults of the page are collected in `page.faults`. */
export async function newPage({ beside, ...options } = {}) {
  const viewport = { width: 1000, height: 640 };
  const context = beside?.context() ?? (await browser.newContext({ viewport, reducedMotion: "reduce", ...options }));
  context.setDefaultTimeout(PATIENCE_MS);
  const page = await context.newPage();
  page.faults = [];
  page.on("pageerror", (error) => page.faults.push(String(error)));
  page.on("console", (message) => /Content.Security.Policy/i.test(message.text()) && page.faults.push(message.text()));
  return page;
}

/** Waits until a condition in the page holds. */
export function until(page, condition, argument) {
  return page.waitForFunction(condition, argument, { timeout: PATIENCE_MS, polling: 20 });
}

/** A file as the inputs of the page take it. */
export const file = (name, content) => ({ name, mimeType: "application/octet-stream", buffer: Buffer.from(content) });

/** Opens a file of the page's own chooser. */
export async function choose(page, ...files) {
  await page.locator(`${bySelector("files-input")}, ${bySelector("open-input")}`).first().setInputFiles(files);
}

/** Drops files on the page. */
export async function drop(page, ...files) {
  const data = await page.evaluateHandle((named) => {
    const transfer = new DataTransfer();
    for (const [name, text] of named) transfer.items.add(new File([text], name));
    return transfer;
  }, files);
  for (const type of ["dragenter", "dragover", "drop"]) await page.dispatchEvent("main", type, { dataTransfer: data });
}

/** Waits until the finished picture of all that is set is shown; its absolute address. */
export async function settled(page) {
  await page.click(bySelector("copy-url"));
  const found = await until(page, () => {
    const of = (name) => document.querySelector(`[data-test="${name}"]`);
    const [picture, text] = [of("picture"), of("copy-text")?.textContent ?? ""];
    if (!picture || picture.dataset.draft !== "false" || of("stage").ariaBusy === "true") return null;
    const isShown = picture.complete && picture.naturalWidth > 0 && picture.src === of("download")?.href;
    return isShown && text.endsWith(picture.dataset.path) ? text : null;
  });
  return found.jsonValue();
}

/** The bytes of the picture that is shown, as the page stores them. */
export async function shownBytes(page) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(bySelector("download"))]);
  return readFileSync(await download.path());
}

/** The bytes at an address. */
export async function bytesAt(address, key) {
  const answer = await fetch(address, key && { headers: { Authorization: `Bearer ${key}` } });
  assert.equal(answer.status, 200, `${address}: ${await answer.clone().text()}`);
  return Buffer.from(await answer.arrayBuffer());
}

/** Waits for the picture of all that is set, and checks that it is what its address gives. */
export async function checkedAddress(page, key) {
  const address = await settled(page);
  const [shown, direct] = [await shownBytes(page), await bytesAt(address, key)];
  assert.ok(shown.equals(direct), `${address}: ${shown.length} bytes are shown, and it gives ${direct.length}`);
  return address;
}

/** The text that the page offers to copy. */
export async function copyText(page, kind) {
  await page.click(bySelector(`copy-${kind}`));
  return page.textContent(bySelector("copy-text"));
}

/** A folder that goes at the end. */
export function folder() {
  const path = mkdtempSync(join(tmpdir(), "meshsnap-page-"));
  folders.push(path);
  return path;
}

/** Runs cases one after the other in one browser. Each is given no page; `newPage` makes those that it needs. */
export async function run(cases) {
  browser = await chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"] });
  let failed = 0;
  for (const [name, test] of Object.entries(cases)) {
    const began = performance.now();
    try {
      await test();
      for (const context of browser.contexts()) {
        for (const page of context.pages()) assert.deepEqual(page.faults, [], "faults in the console");
      }
      console.log(`ok: ${name} (${Math.round(performance.now() - began)} ms)`);
    } catch (error) {
      failed++;
      console.log(`FAILED: ${name} (${Math.round(performance.now() - began)} ms)\n${error.stack}`);
      for (const page of browser.contexts().flatMap((context) => context.pages())) {
        const body = await page.locator("body").innerText({ timeout: 1000 }).catch(() => "");
        console.log(`${page.url()} ${JSON.stringify(page.faults)} shows:\n${body.slice(0, 1500)}`);
      }
    }
    await Promise.all(browser.contexts().map((context) => context.close()));
    await Promise.all([...children].map((child) => child.kill("SIGKILL")));
    children.clear();
  }
  await browser.close();
  for (const path of folders) rmSync(path, { recursive: true });
  process.exitCode = failed > 0 ? 1 : 0;
}
