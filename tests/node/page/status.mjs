// The page at `/status`: a job that runs, a failure, and who may see it.

import assert from "node:assert/strict";
import { bySelector, CUBE, keyFlags, newPage, run, serve, until } from "./lib.mjs";

const rows = (page, name) => page.locator(`${bySelector(name)} tbody tr`).allInnerTexts();

await run({
  "a job and a failure are shown": async () => {
    const { url } = await serve(["--workers", "1"]);
    const page = await newPage();
    await page.goto(`${url}status`);
    await page.waitForSelector(bySelector("tiles"));
    // The first keeps the worker busy until it is cancelled, and the others wait.
    const send = async (query, body) => (await fetch(`${url}v1/jobs?${query}`, { method: "POST", body })).headers.get("location");
    const jobs = [];
    for (let i = 0; i < 30; i++) jobs.push(await send("size=4096&samples=16&style=technical", CUBE));
    await until(page, () => /1 of 1/.test(document.querySelector('[data-test="tiles"]').textContent));
    await until(page, () => {
      const all = [...document.querySelectorAll('[data-test="queue"] tbody tr')];
      return all.some((row) => /batch/.test(row.textContent) && /[1-9]/.test(row.cells[1].textContent));
    });
    for (const job of jobs) await fetch(new URL(job, url), { method: "DELETE" });
    assert.equal((await fetch(`${url}v1/render?sise=16`, { method: "POST", body: CUBE })).status, 400);
    const failed = await send("size=16", "no mesh at all");
    await fetch(new URL(failed, url), { headers: { Prefer: "wait=60" } });
    await until(page, () => {
      const text = document.querySelector('[data-test="failures"]')?.textContent ?? "";
      return text.includes("unknown_key") && text.includes("mesh_unrecognised");
    });
    const { failures } = await (await fetch(`${url}v1/status`)).json();
    assert.equal((await rows(page, "failures")).length, failures.length);
  },

  "a key with the scope admin is asked for": async () => {
    const { url } = await serve(keyFlags({ boss: ["admin"], viewer: ["render"] }));
    const enter = async (page, key) => {
      await page.goto(`${url}status`);
      await page.fill(bySelector("key"), key);
      await page.click(bySelector("key-use"));
    };
    const page = await newPage();
    await enter(page, "boss");
    await page.waitForSelector(bySelector("tiles"));
    await page.waitForSelector(bySelector("key-form"), { state: "detached" });
    const other = await newPage();
    await enter(other, "viewer");
    await until(other, () => document.querySelector('[data-test="trouble"]')?.textContent.includes("admin"));
    assert.equal(await other.locator(bySelector("tiles")).count(), 0);
    // Another key may be given at once.
    await other.fill(bySelector("key"), "boss");
    await other.click(bySelector("key-use"));
    await other.waitForSelector(bySelector("tiles"));
    await other.waitForSelector(bySelector("trouble"), { state: "detached" });
  },
});
