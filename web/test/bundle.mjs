// Bundles modules of the page for tests in Node, with the few things of a browser that they touch.

import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import * as esbuild from "esbuild";

const root = dirname(dirname(fileURLToPath(import.meta.url)));

globalThis.location = new URL("https://meshes.example/tools/mesh/#mesh=1");
globalThis.window = { devicePixelRatio: 1 };
globalThis.sessionStorage = { getItem: () => null, setItem() {}, removeItem() {} };

/** Imports what the modules export, as one object. */
export async function load(...modules) {
  const contents = modules.map((name) => `export * from "./src/${name}";`).join("\n");
  const { outputFiles } = await esbuild.build({
    stdin: { contents, resolveDir: root, loader: "ts" },
    bundle: true,
    format: "esm",
    platform: "node",
    jsx: "automatic",
    jsxImportSource: "preact",
    write: false,
  });
  const folder = mkdtempSync(join(root, "node_modules/.test-"));
  const file = join(folder, "bundle.mjs");
  writeFileSync(file, outputFiles[0].text);
  try {
    return await import(pathToFileURL(file).href);
  } finally {
    rmSync(folder, { recursive: true });
  }
}
