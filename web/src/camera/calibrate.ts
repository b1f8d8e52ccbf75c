import { request } from "../api/client";
import { picturePath } from "../state/address";
import type { Keys, Look, Value } from "../state/look";
import type { OpenMesh } from "../state/mesh";
import { type Size, within } from "../state/size";
import { anglesOf, axesOf, type Placed } from "./orbit";
import { add, length, rounded, scale, sub, type Vec } from "./vector";

/** Rectangle of what is drawn, in shares of half the picture's height from its middle. */
interface Extent {
  x: number;
  y: number;
  size: number;
}

const SIDE_PX = 256;
const ROUNDS = 3;
const CLOSE_ENOUGH = 0.004;

/**
 * Finds a placed camera that shows the mesh as the fitted one does, because the server says only what
 * a fitted camera draws. Small pictures of both are compared, and the placed camera is moved.
 */
export async function placeAsFitted(
  mesh: OpenMesh,
  look: Look,
  up: string,
  bounds: { min: Vec; max: Vec },
  picture: Size,
): Promise<Placed> {
  const size = within(picture, SIDE_PX);
  const fov = numberOf(look.keys["camera.fov_deg"], 35);
  const parallel = look.keys["camera.projection"] === "orthographic";
  const axes = axesOf(anglesOf(look.keys, up), up);
  const radius = 0.5 * length(sub(bounds.max, bounds.min)) || 1;
  const half = Math.tan((fov * Math.PI) / 360);
  let target = scale(add(bounds.min, bounds.max), 0.5);
  let far = (radius * 1.1) / Math.sin((Math.min(fov, 120) * Math.PI) / 360);
  let height = radius * 2.2;
  const wanted = await measure(mesh, silhouette(look, {}), size);
  const placed = (): Placed => ({
    eye: rounded(add(target, scale(axes[2], parallel ? radius * 4 : far)), far),
    target: rounded(target, far),
    height: parallel ? Number(height.toPrecision(6)) : null,
  });
  for (let round = 0; wanted && round < ROUNDS; round++) {
    const found = await measure(mesh, silhouette(look, placedKeys(placed())), size);
    if (!found) break;
    const grow = wanted.size / found.size;
    const unit = parallel ? height / 2 : far * half;
    const dx = (found.x - wanted.x / grow) * unit;
    const dy = (found.y - wanted.y / grow) * unit;
    target = add(target, add(scale(axes[0], dx), scale(axes[1], dy)));
    far /= grow;
    height /= grow;
    if (Math.abs(grow - 1) < CLOSE_ENOUGH && Math.hypot(found.x - wanted.x, found.y - wanted.y) < CLOSE_ENOUGH) break;
  }
  return placed();
}

const numberOf = (value: Value | undefined, otherwise: number): number =>
  typeof value === "number" ? value : otherwise;

/** Keys of a placed camera. */
export function placedKeys(placed: Placed): Record<string, Value> {
  const keys: Record<string, Value> = { "camera.eye": placed.eye, "camera.target": placed.target };
  if (placed.height !== null) keys["camera.height"] = placed.height;
  return keys;
}

/** A plain look of the same view on a transparent background. */
function silhouette(look: Look, placed: Keys): Look {
  const camera = Object.entries(look.keys).filter(([key]) => key.startsWith("camera."));
  const keys: Record<string, Value> = { ...Object.fromEntries(camera), ...placed };
  if ("camera.eye" in placed) {
    for (const name of ["view", "azimuth_deg", "elevation_deg"]) delete keys[`camera.${name}`];
  }
  if ("scene.time_s" in look.keys) keys["scene.time_s"] = look.keys["scene.time_s"] ?? null;
  keys["style"] = "unlit";
  keys["image.background"] = "transparent";
  keys["image.samples"] = 4;
  return { keys, materials: {} };
}

/** Draws a picture and finds the rectangle of what is not transparent. */
async function measure(mesh: OpenMesh, look: Look, size: Size): Promise<Extent | null> {
  const answer = await request(picturePath({ mesh, look, size, format: "webp" }));
  const bitmap = await createImageBitmap(await answer.blob());
  const canvas = document.createElement("canvas");
  canvas.width = bitmap.width;
  canvas.height = bitmap.height;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) return null;
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
  return extentOf(data, bitmap.width, bitmap.height);
}

function extentOf(data: Uint8ClampedArray, width: number, height: number): Extent | null {
  let [left, right, top, bottom] = [width, -1, height, -1];
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      if ((data[4 * (y * width + x) + 3] ?? 0) < 100) continue;
      if (x < left) left = x;
      if (x > right) right = x;
      if (y < top) top = y;
      if (y > bottom) bottom = y;
    }
  }
  if (right < left) return null;
  const half = height / 2;
  return {
    x: ((left + right + 1) / 2 - width / 2) / half,
    y: (half - (top + bottom + 1) / 2) / half,
    size: Math.hypot(right + 1 - left, bottom + 1 - top) / half,
  };
}
