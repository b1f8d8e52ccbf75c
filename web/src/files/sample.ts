/** Text of a small mesh to try the page with: a knot of quads over a plate that is open below. */
export function sampleObj(): string {
  const lines = ["# Sample: a trefoil knot on a plate", "o sample"];
  const vertices: string[] = [];
  const faces: string[] = ["usemtl Knot"];
  knot(vertices, faces);
  faces.push("usemtl Plate");
  plate(vertices, faces);
  return [...lines, ...vertices, ...faces, ""].join("\n");
}

type P = [number, number, number];

/** A vertex with its colour: warm to cool by `share`. */
function vertex(p: P, share: number): string {
  const colour = [0.86 - 0.5 * share, 0.42 + 0.16 * share, 0.3 + 0.42 * share];
  return `v ${p.map((v) => v.toFixed(4)).join(" ")} ${colour.map((v) => v.toFixed(3)).join(" ")}`;
}

function curve(t: number): P {
  const r = 2 + Math.cos(3 * t);
  return [r * Math.cos(2 * t) * 0.4, 1.5 + r * Math.sin(2 * t) * 0.4, Math.sin(3 * t) * 0.5];
}

/** A tube around the curve. Its frame is carried along, and the small turn at its end spread out. */
function knot(vertices: string[], faces: string[]): void {
  const [rings, sides, radius] = [96, 12, 0.2];
  for (let i = 0; i < rings; i++) {
    const t = (i / rings) * 2 * Math.PI;
    const [p, q] = [curve(t), curve(t + 0.01)];
    const along = normal([q[0] - p[0], q[1] - p[1], q[2] - p[2]]);
    const out = normal(cross(along, [0, 0, 1]));
    const side = cross(along, out);
    for (let j = 0; j < sides; j++) {
      const a = (j / sides) * 2 * Math.PI;
      const at = (k: 0 | 1 | 2) => p[k] + radius * (out[k] * Math.cos(a) + side[k] * Math.sin(a));
      vertices.push(vertex([at(0), at(1), at(2)], 0.5 - 0.5 * Math.cos(t)));
    }
  }
  const id = (i: number, j: number) => (i % rings) * sides + (j % sides) + 1;
  for (let i = 0; i < rings; i++) {
    for (let j = 0; j < sides; j++) faces.push(`f ${id(i, j)} ${id(i, j + 1)} ${id(i + 1, j + 1)} ${id(i + 1, j)}`);
  }
}

/** A round plate with a rim and no bottom, so that the mesh has open edges to look at. */
function plate(vertices: string[], faces: string[]): void {
  const [sides, first] = [48, vertices.length + 1];
  for (const [radius, y] of [
    [1.1, 0.14],
    [1.2, 0.04],
    [1.2, -0.1],
  ] as const) {
    for (let j = 0; j < sides; j++) {
      const a = (j / sides) * 2 * Math.PI;
      vertices.push(vertex([radius * Math.cos(a), y, radius * -Math.sin(a)], 0.9));
    }
  }
  const id = (ring: number, j: number) => first + ring * sides + (j % sides);
  faces.push(`f ${Array.from({ length: sides }, (_, j) => id(0, j)).join(" ")}`);
  for (let ring = 0; ring < 2; ring++) {
    for (let j = 0; j < sides; j++) {
      faces.push(`f ${id(ring + 1, j)} ${id(ring + 1, j + 1)} ${id(ring, j + 1)} ${id(ring, j)}`);
    }
  }
}

function cross(a: P, b: P): P {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function normal(a: P): P {
  const long = Math.hypot(...a) || 1;
  return [a[0] / long, a[1] / long, a[2] / long];
}
