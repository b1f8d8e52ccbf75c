// The pages behind a proxy that serves them below a path.

import assert from "node:assert/strict";
import http from "node:http";
import { bySelector, checkedAddress, choose, copyText, CUBE, file, newPage, run, serve } from "./lib.mjs";

const PREFIX = "/some/prefix";

/** A proxy that takes the prefix off each path, and knows no other paths. */
function proxy(port) {
  const server = http.createServer((request, answer) => {
    if (!request.url.startsWith(`${PREFIX}/`)) return answer.writeHead(404).end();
    const { method, headers } = request;
    const path = request.url.slice(PREFIX.length);
    const upstream = http.request({ host: "127.0.0.1", port, path, method, headers }, (from) => {
      answer.writeHead(from.statusCode, from.headers);
      from.pipe(answer);
    });
    upstream.on("error", () => answer.destroy());
    answer.on("close", () => upstream.destroy());
    request.pipe(upstream);
  });
  return new Promise((ready) => server.listen(0, "127.0.0.1", () => ready(server)));
}

await run({
  "the pages work below a path": async () => {
    const { port } = await serve();
    const server = await proxy(port);
    try {
      const base = `http://127.0.0.1:${server.address().port}${PREFIX}/`;
      const page = await newPage();
      const lost = [];
      page.on("response", (answer) => answer.status() >= 400 && lost.push(`${answer.status()} ${answer.url()}`));
      await page.goto(base);
      await choose(page, file("cube.obj", CUBE));
      const address = await checkedAddress(page);
      assert.ok(address.startsWith(`${base}v1/meshes/`), address);
      for (const kind of ["curl", "python", "javascript", "markdown", "srcset"]) {
        assert.ok((await copyText(page, kind)).includes(`${base}v1/meshes/`), kind);
      }
      const status = await newPage();
      await status.goto(`${base}status`);
      await status.waitForSelector(bySelector("tiles"));
      const links = await status.locator("a").evaluateAll((all) => all.map((one) => one.href));
      assert.ok(links.length > 0 && links.every((link) => link.startsWith(base)), `${links}`);
      assert.deepEqual(lost, []);
    } finally {
      server.closeAllConnections();
      server.close();
    }
  },
});
