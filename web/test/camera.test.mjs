import assert from "node:assert/strict";
import test from "node:test";
import { load } from "./bundle.mjs";

const { anglesOf, axesOf, orbited, turned, zoomed, panned } = await load("camera/orbit.ts");
const near = (a, b) => a.forEach((v, i) => assert.ok(Math.abs(v - b[i]) < 1e-4, `${a} is not ${b}`));

test("the front is where formats have it", () => {
  near(axesOf({ azimuth: 0, elevation: 0 }, "y")[2], [0, 0, 1]);
  near(axesOf({ azimuth: 90, elevation: 0 }, "y")[2], [1, 0, 0]);
  near(axesOf({ azimuth: 0, elevation: 0 }, "z")[2], [0, -1, 0]);
  near(axesOf({ azimuth: 0, elevation: 90 }, "y")[2], [0, 1, 0]);
});

test("a placed camera has the angles that it was turned to", () => {
  for (const up of ["y", "z", "-y", "-z", "x", "-x"]) {
    const placed = orbited({ eye: [0, 0, 5], target: [1, 2, 3], height: null }, { azimuth: -120, elevation: 35 }, up);
    const { azimuth, elevation } = anglesOf({ "camera.eye": placed.eye, "camera.target": placed.target }, up);
    near([azimuth, elevation], [-120, 35]);
  }
});

test("angles stay in what the server takes", () => {
  assert.deepEqual(turned({ azimuth: 170, elevation: 80 }, 20, 30), { azimuth: -170, elevation: 90 });
});

test("zoom and pan keep the direction", () => {
  const placed = { eye: [0, 0, 10], target: [0, 0, 0], height: null };
  near(zoomed(placed, 2).eye, [0, 0, 5]);
  const moved = panned(placed, 0.5, 0, 90, "y");
  near(moved.target, [10, 0, 0]);
  near(moved.eye, [10, 0, 10]);
});
