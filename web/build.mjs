// Build of the two pages: bundles scripts and styles, and writes each page as one HTML file.
//
//     node build.mjs [--out FOLDER]

import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import * as esbuild from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const PAGES = ["index", "status"];
const SIZE_LIMIT_BYTES = 150_000;

const OPTIONS = {
  absWorkingDir: here,
  bundle: true,
  minify: true,
  legalComments: "none",
  charset: "utf8",
  target: ["chrome111", "firefox113", "safari16.4"],
  write: false,
};

async function bundle(entry, more) {
  const result = await esbuild.build({ ...OPTIONS, entryPoints: [entry], ...more });
  return result.outputFiles[0].text.trim();
}

/** Builds one page: the template with its style and script in place of the two marks. */
async function page(name) {
  const script = await bundle(`src/${name}.tsx`, {
    format: "esm",
    jsx: "automatic",
    jsxImportSource: "preact",
    define: { "process.env.NODE_ENV": '"production"' },
  });
  const style = await bundle(`src/style/${name}.css`, { loader: { ".css": "css" } });
  const template = readFileSync(join(here, `src/${name}.html`), "utf8");
  return template
    .replace("/* style */", () => style)
    .replace("/* script */", () => script.replaceAll("</script", "<\\/script"));
}

const at = process.argv.indexOf("--out");
const out = at > 0 ? process.argv[at + 1] : join(here, "../src/server/page");
mkdirSync(out, { recursive: true });
for (const name of PAGES) {
  const html = await page(name);
  const packed = gzipSync(html).length;
  writeFileSync(join(out, `${name}.html`), html);
  console.log(`${name}.html: ${html.length} bytes, ${packed} gzipped`);
  if (packed > SIZE_LIMIT_BYTES) {
    console.error(`${name}.html is larger than ${SIZE_LIMIT_BYTES} bytes gzipped`);
    process.exitCode = 1;
  }
}
