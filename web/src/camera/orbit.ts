import type { Keys } from "../state/look";
import { add, cross, dot, isVec, length, rounded, scale, sub, unit, type Vec } from "./vector";

/** Direction to the viewer, in degrees. */
export interface Angles {
  azimuth: number;
  elevation: number;
}

/** A camera that does not fit the mesh: where it is and looks, and the height of a parallel view. */
export interface Placed {
  eye: Vec;
  target: Vec;
  height: number | null;
}

const VIEWS: Record<string, Angles> = {
  auto: { azimuth: 30, elevation: 20 },
  iso: { azimuth: 45, elevation: 30 },
  front: { azimuth: 0, elevation: 0 },
  back: { azimuth: 180, elevation: 0 },
  right: { azimuth: 90, elevation: 0 },
  left: { azimuth: -90, elevation: 0 },
  top: { azimuth: 0, elevation: 90 },
  bottom: { azimuth: 0, elevation: -90 },
};

/** Model right, up and front for an up axis, as the server has them. */
export function frameOf(up: string): [Vec, Vec, Vec] {
  const axes: Record<string, [Vec, Vec]> = {
    "y": [
      [1, 0, 0],
      [0, 1, 0],
    ],
    "-y": [
      [1, 0, 0],
      [0, -1, 0],
    ],
    "z": [
      [1, 0, 0],
      [0, 0, 1],
    ],
    "-z": [
      [1, 0, 0],
      [0, 0, -1],
    ],
    "x": [
      [0, -1, 0],
      [1, 0, 0],
    ],
    "-x": [
      [0, 1, 0],
      [-1, 0, 0],
    ],
  };
  const [right, upwards] = axes[up] ?? axes["y"]!;
  return [right, upwards, cross(right, upwards)];
}

/** Unit vectors to the picture's right, its top, and the viewer. */
export function axesOf({ azimuth, elevation }: Angles, up: string): [Vec, Vec, Vec] {
  const [right, upwards, front] = frameOf(up);
  const a = (azimuth * Math.PI) / 180;
  const e = (elevation * Math.PI) / 180;
  const level = add(scale(right, Math.sin(a)), scale(front, Math.cos(a)));
  const back = add(scale(level, Math.cos(e)), scale(upwards, Math.sin(e)));
  const side = sub(scale(right, Math.cos(a)), scale(front, Math.sin(a)));
  return [side, cross(back, side), back];
}

export function placedOf(keys: Keys): Placed | null {
  const eye = keys["camera.eye"];
  const target = keys["camera.target"];
  const height = keys["camera.height"];
  if (!isVec(eye) || !isVec(target)) return null;
  return { eye, target, height: typeof height === "number" ? height : null };
}

/** Direction of the camera, of whichever keys it is made. */
export function anglesOf(keys: Keys, up: string): Angles {
  const placed = placedOf(keys);
  if (placed) return anglesOfDirection(sub(placed.eye, placed.target), up);
  const named = VIEWS[String(keys["camera.view"] ?? "auto")] ?? VIEWS["auto"]!;
  const azimuth = keys["camera.azimuth_deg"];
  const elevation = keys["camera.elevation_deg"];
  return {
    azimuth: typeof azimuth === "number" ? azimuth : named.azimuth,
    elevation: typeof elevation === "number" ? elevation : named.elevation,
  };
}

function anglesOfDirection(direction: Vec, up: string): Angles {
  const [right, upwards, front] = frameOf(up);
  const back = unit(direction) ?? front;
  const azimuth = (Math.atan2(dot(back, right), dot(back, front)) * 180) / Math.PI;
  const elevation = (Math.asin(Math.max(-1, Math.min(1, dot(back, upwards)))) * 180) / Math.PI;
  return { azimuth: round(azimuth), elevation: round(elevation) };
}

const round = (v: number): number => Math.round(v * 10) / 10;

/** Angles after a turn, within what the server takes. */
export function turned({ azimuth, elevation }: Angles, right: number, upwards: number): Angles {
  const around = ((((azimuth + right + 180) % 360) + 360) % 360) - 180;
  return { azimuth: round(around), elevation: round(Math.max(-90, Math.min(90, elevation + upwards))) };
}

/** Turns a placed camera around its target. A placed camera has no direction of up at the poles. */
export function orbited(placed: Placed, angles: Angles, up: string): Placed {
  const safe = { ...angles, elevation: Math.max(-89.9, Math.min(89.9, angles.elevation)) };
  const far = length(sub(placed.eye, placed.target));
  const back = axesOf(safe, up)[2];
  return { ...placed, eye: rounded(add(placed.target, scale(back, far)), far) };
}

/** Brings a placed camera nearer by `factor`. */
export function zoomed(placed: Placed, factor: number): Placed {
  const away = scale(sub(placed.eye, placed.target), 1 / factor);
  const height = placed.height === null ? null : Number((placed.height / factor).toPrecision(6));
  return { target: placed.target, eye: rounded(add(placed.target, away), length(away)), height };
}

/** Moves a placed camera sideways, by shares of the picture's height at the target. */
export function panned(placed: Placed, right: number, upwards: number, fovDeg: number, up: string): Placed {
  const away = sub(placed.eye, placed.target);
  const far = length(away);
  const tall = placed.height ?? 2 * far * Math.tan((fovDeg * Math.PI) / 360);
  const [side, top] = axesOf(anglesOfDirection(away, up), up);
  const by = add(scale(side, right * tall), scale(top, upwards * tall));
  return { ...placed, eye: rounded(add(placed.eye, by), far), target: rounded(add(placed.target, by), far) };
}
