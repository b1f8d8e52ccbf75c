import { signal } from "@preact/signals";
import type { NamedFile } from "../api/upload";
import type { Capabilities, Report } from "../api/types";

/** A mesh that the server has. */
export interface OpenMesh {
  sha256: string;
  /** Name for people and for copied lines: the file's, or the digest's beginning. */
  name: string;
  entry: string | null;
  formatIn: string | null;
  /** The files, if they came from this page: they are sent again if the server has lost them. */
  files: NamedFile[] | null;
}

export const mesh = signal<OpenMesh | null>(null);
export const report = signal<Report | null>(null);
export const capabilities = signal<Capabilities | null>(null);

/** Query pairs that say how the mesh is read. */
export function readingPairs(of: OpenMesh): [string, string][] {
  const pairs: [string, string][] = [];
  if (of.entry !== null) pairs.push(["entry", of.entry]);
  if (of.formatIn !== null) pairs.push(["format_in", of.formatIn]);
  return pairs;
}

/** Name of a mesh without its folders and extension, for files that are made of it. */
export function stem(of: OpenMesh): string {
  const file = of.name.split(/[\\/]/).at(-1) ?? of.name;
  return (
    file
      .replace(/\.[a-z0-9]{1,5}$/i, "")
      .replace(/[^\p{L}\p{N}._ -]/gu, "_")
      .trim() || "mesh"
  );
}
