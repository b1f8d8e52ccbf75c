export type Vec = [number, number, number];

export const add = (a: Vec, b: Vec): Vec => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec, b: Vec): Vec => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vec, k: number): Vec => [a[0] * k, a[1] * k, a[2] * k];
export const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec, b: Vec): Vec => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const length = (a: Vec): number => Math.hypot(...a);

/** The vector of length 1, or null where it has no direction. */
export function unit(a: Vec): Vec | null {
  const long = length(a);
  return long > 0 && Number.isFinite(long) ? scale(a, 1 / long) : null;
}

/** Rounds to six significant digits of `around`, so that addresses stay short. */
export function rounded(a: Vec, around: number): Vec {
  const step = 10 ** (Math.floor(Math.log10(around || 1)) - 5);
  return a.map((v) => Number((Math.round(v / step) * step).toPrecision(10))) as Vec;
}

export function isVec(value: unknown): value is Vec {
  return Array.isArray(value) && value.length === 3 && value.every((v) => typeof v === "number");
}
