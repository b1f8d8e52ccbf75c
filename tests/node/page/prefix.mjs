// The pages behind a proxy that serves them below a path.

import assert from "node:assert/strict";
import { bySelector, checkedAddress, choose, copyText, CUBE, file, newPage, run, serve } from "./lib.mjs";
import { proxy } from "./proxy.mjs";

await run({
  "the pages work below a path": async () => {
    const { port } = await serve();
    const front = await proxy(port, "/some/prefix");
    try {
      const base = front.url;
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
      front.close();
    }
  },
});
