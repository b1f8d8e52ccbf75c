import type { components } from "./openapi";

type Schemas = components["schemas"];

export type Problem = Schemas["Problem"];
export type StoredMesh = Schemas["Mesh"];
export type Verdict = Schemas["Verdict"];
export type Difference = Schemas["Difference"];
export type Report = Schemas["Report"];
export type Position = [number, number, number];

/** What the page reads of /v1/capabilities. */
export interface Capabilities {
  version: string;
  mesh_formats: string[];
  image_formats: string[];
  styles: string[];
  check_rules: string[];
  paths: string[];
  limits: { body_bytes: number; bundle_entries: number; image_px: number };
}
