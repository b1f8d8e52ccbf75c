import type { Look } from "../state/look";

/** Looks that go beyond a style. */
export const PRESETS: { name: string; look: Look }[] = [
  {
    name: "red lines",
    look: of({ "style": "clay", "wire.edges": "polygons", "wire.color": "#e02020", "wire.thickness": 2 }),
  },
  {
    name: "blueprint",
    look: of({
      "style": "technical",
      "surface.shading": "unlit",
      "surface.color": "#164277",
      "wire.color": "#cfe3ff",
      "outline.color": "#cfe3ff",
      "image.background": "#123a6b..#0b2547",
    }),
  },
  {
    name: "studio",
    look: of({
      "light.preset": "studio",
      "image.background": "#fff..#d9dee6",
      "scene.ground": "shadow",
      "camera.margin": 0.1,
    }),
  },
  {
    name: "comic",
    look: of({
      "style": "outline",
      "outline.unit": "px",
      "outline.thickness": 4,
      "surface.shading": "flat",
      "light.preset": "three-point",
    }),
  },
  {
    name: "night wire",
    look: of({ "style": "wire", "surface.color": "#20242c", "wire.color": "#6ee7d8", "image.background": "#14171c" }),
  },
  {
    name: "open edges",
    look: of({
      "style": "clay",
      "surface.color": "#dfe3e8",
      "wire.edges": "boundary",
      "wire.color": "#f05a1e",
      "wire.thickness": 3,
      "wire.hidden": "show",
    }),
  },
  { name: "normals", look: of({ "surface.debug": "normal" }) },
  { name: "curvature", look: of({ "surface.debug": "curvature", "image.legend": true }) },
  { name: "orientation", look: of({ "surface.debug": "face-orientation" }) },
  { name: "four views", look: of({ "style": "technical", "sheet.labels": true, "camera.projection": "orthographic" }) },
  { name: "turntable", look: of({ "sheet.turntable": 16 }) },
];

function of(keys: Look["keys"]): Look {
  return { keys, materials: {} };
}
