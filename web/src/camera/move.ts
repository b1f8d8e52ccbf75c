import { signal } from "@preact/signals";
import { isVec } from "./vector";
import { touch } from "../picture/live";
import { setKeys } from "../state/edit";
import { look } from "../state/history";
import { hasNamedViews, type Value } from "../state/look";
import { mesh, report } from "../state/mesh";
import { pictureSize } from "../state/size";
import { placeAsFitted, placedKeys } from "./calibrate";
import { type Angles, anglesOf, orbited, panned, type Placed, placedOf, turned, zoomed } from "./orbit";
import { add, cross, length, rounded, scale, sub, unit, type Vec } from "./vector";

const NO_ANGLES = { "camera.view": undefined, "camera.azimuth_deg": undefined, "camera.elevation_deg": undefined };
const NOT_PLACED = { "camera.eye": undefined, "camera.target": undefined, "camera.height": undefined };

export function upOf(): string {
  const given = look.value.keys["camera.up"];
  return typeof given === "string" ? given : String(report.value?.up ?? "y");
}

export function angles(): Angles {
  return anglesOf(look.value.keys, upOf());
}

/** Turns the camera by degrees. A sheet of named views has no camera to turn. */
export function turn(right: number, upwards: number): void {
  if (hasNamedViews(look.value.keys)) return;
  face(turned(angles(), right, upwards));
}

function face(to: Angles): void {
  const placed = placedOf(look.value.keys);
  const own: Record<string, Value | undefined> = placed
    ? placedKeys(orbited(placed, to, upOf()))
    : { "camera.azimuth_deg": to.azimuth, "camera.elevation_deg": to.elevation, "camera.view": undefined };
  setKeys("camera", { ...own, "camera.from_file": undefined });
}

/** Fits the mesh into the picture, from the same direction. */
export function fit(): void {
  const { azimuth, elevation } = angles();
  const placed = placedOf(look.value.keys);
  const own = placed ? { "camera.azimuth_deg": azimuth, "camera.elevation_deg": elevation } : {};
  setKeys("fit", { ...NOT_PLACED, ...own, "camera.from_file": undefined, "camera.margin": undefined });
}

/** Fits the mesh if a placed camera, which may be of another mesh, looks past it. */
export function fitIfAway(): void {
  const placed = placedOf(look.value.keys);
  const bounds = report.value?.bounds as { min: Vec; max: Vec } | null | undefined;
  if (!placed || !bounds) return;
  const middle = scale(add(bounds.min, bounds.max), 0.5);
  const whole = length(sub(bounds.max, bounds.min));
  const far = length(sub(placed.eye, placed.target));
  if (length(sub(placed.target, middle)) > whole || far > whole * 50) fit();
}

/** Shows a named view, fitted. */
export function showView(view: string): void {
  setKeys("view", { ...NO_ANGLES, ...NOT_PLACED, "camera.from_file": undefined, "camera.view": view });
}

let placing: Promise<Placed | null> | null = null;
let zoomWaiting = 1;

/** The placed camera, made from the fitted one if there is none yet. */
async function place(): Promise<Placed | null> {
  const placed = placedOf(look.value.keys);
  if (placed) return placed;
  const open = mesh.value;
  const bounds = report.value?.bounds as { min: Vec; max: Vec } | null | undefined;
  if (!open || !bounds || hasNamedViews(look.value.keys)) return null;
  placing ??= placeAsFitted(open, look.value, upOf(), bounds, pictureSize.value)
    .catch(() => null)
    .finally(() => (placing = null));
  return placing;
}

function put(placed: Placed): void {
  setKeys("camera", { ...NO_ANGLES, ...placedKeys(placed), "camera.from_file": undefined });
}

/** Brings the camera nearer by a factor. Steps that come while it is being placed add up. */
export async function zoom(factor: number): Promise<void> {
  touch();
  zoomWaiting *= factor;
  const placed = await place();
  const by = zoomWaiting;
  zoomWaiting = 1;
  if (!placed || by === 1) return;
  touch();
  put(zoomed(placed, by));
}

/** Moves the camera sideways, by shares of the picture's height. */
export async function pan(right: number, upwards: number): Promise<void> {
  const placed = await place();
  const fov = look.value.keys["camera.fov_deg"];
  if (placed) put(panned(placed, right, upwards, typeof fov === "number" ? fov : 35, upOf()));
}

/** The point that the camera was last sent to. */
const faultTarget = signal<Vec | null>(null);

/** True while the fault that was chosen is in the picture's middle. */
export function isAtFault(): boolean {
  return faultTarget.value !== null && String(look.value.keys["camera.target"]) === String(faultTarget.value);
}

/** Places the camera in front of a point, edge or face, from the side that faces outwards. */
export function flyTo(points: Vec[]): void {
  const bounds = report.value?.bounds as { min: Vec; max: Vec } | null | undefined;
  const first = points[0];
  if (!bounds || !first || !points.every(isVec)) return;
  const whole = length(sub(bounds.max, bounds.min)) || 1;
  const middle = scale(
    points.reduce((a, b) => add(a, b), [0, 0, 0] as Vec),
    1 / points.length,
  );
  const spread = Math.max(...points.map((p) => length(sub(p, middle))));
  const far = Math.max(spread * 8, whole * 0.35);
  const outwards = unit(sub(middle, scale(add(bounds.min, bounds.max), 0.5))) ?? [0, 0, 1];
  const [a, b, c] = points;
  const normal = a && b && c ? unit(cross(sub(b, a), sub(c, a))) : null;
  const eye = add(middle, scale(normal ?? outwards, far));
  const height = look.value.keys["camera.projection"] === "orthographic" ? far * 0.6 : null;
  faultTarget.value = rounded(middle, far * 0.01);
  put({ eye: rounded(eye, far), target: faultTarget.value, height });
}
