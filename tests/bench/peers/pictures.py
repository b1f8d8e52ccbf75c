"""Error of whole pictures beside VTK's: see tests/bench/peers/run --pictures.

An icosphere (an icosahedron, subdivided once) of 80 faces, each of one colour, over black. It is convex, so the truth of
each pixel is a sum of polygon areas. Camera and colours are the same; there is no light. Two pictures are compared:
white faces, whose pixels are coverage, and faces in greys, as flat shading would have them.

meshsnap blends linear light; VTK blends that or encoded colours, as the driver has it, so that the one that fits better
counts. Errors are in the scale of the blending, where they are errors of coverage: in steps of 1/255, over the pixels that
picture or truth touch. FLIP (Andersson et al. 2020) compares what is shown. VTK's SSAA has about 5 samples per pixel and a
filter wider than a pixel, which is a part of its error.
"""

import math
import os
import subprocess
import sys
import tempfile

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")

import numpy
import pyvista
from flip_evaluator import evaluate

SIZE_PX = 256
EYE, FOV_DEG = (1.9, 1.3, 2.6), 40.0
MSAA_SAMPLES = 8


def main():
    program = os.path.abspath(sys.argv[1])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in ("white", "greys"):
            faces = icosphere(name == "greys")
            path = os.path.join(folder, f"{name}.ply")
            write_ply(path, faces)
            truths = {blending: truth(faces, blending) for blending in ("linear", "encoded")}
            for samples in ("1", "4", "8", "16", "adaptive"):
                picture = ours(program, path, samples)
                rows.append((name, f"meshsnap, {samples} samples", *errors(picture, truths["linear"], to_linear)))
            for label, antialiasing in (("no anti-aliasing", None), ("MSAA", "msaa"), ("SSAA", "ssaa")):
                picture, samples = vtk(path, antialiasing)
                label = label if antialiasing != "msaa" else f"MSAA, {samples} samples ({MSAA_SAMPLES} asked)"
                by_blending = errors(picture, truths["linear"], to_linear), errors(picture, truths["encoded"], lambda v: v)
                rows.append((name, f"VTK, {label}", *min(by_blending)))
    print(f"{'picture':8} {'':36} {'RMSE':>7} {'largest':>8} {'FLIP':>8}")
    for name, label, rmse, largest, flip in rows:
        print(f"{name:8} {label:36} {rmse:7.2f} {largest:8.1f} {flip:8.5f}")
    of = lambda name, label: next(row[2] for row in rows if row[:2] == (name, label))
    adaptive = of("white", "meshsnap, adaptive samples")
    others = min(row[2] for row in rows if row[0] == "white" and row[1].startswith("VTK"))
    print(f"coverage: adaptive samples err by {adaptive:.2f}/255, VTK's best picture by {others:.2f}/255")
    sys.exit(0 if adaptive < others else 1)


def icosphere(is_shaded):
    """Its triangles, each with an encoded grey."""
    phi = (1 + math.sqrt(5)) / 2
    corners = [(s * a, t * b, 0) for a, b in ((1, phi),) for s in (-1, 1) for t in (-1, 1)]
    corners = [numpy.roll(corner, k) for corner in corners for k in range(3)]
    corners = [corner / numpy.linalg.norm(corner) for corner in corners]
    edge = min(numpy.linalg.norm(a - b) for i, a in enumerate(corners) for b in corners[:i])
    near = lambda a, b: numpy.linalg.norm(a - b) < 1.01 * edge
    unit = lambda v: v / numpy.linalg.norm(v)
    light = unit(numpy.array(EYE) + (1.0, 2.0, 0.0))
    faces = []
    for i, a in enumerate(corners):
        for j, b in enumerate(corners[:i]):
            for c in corners[:j]:
                if not (near(a, b) and near(b, c) and near(a, c)):
                    continue
                ab, bc, ca = unit(a + b), unit(b + c), unit(c + a)
                for triangle in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)):
                    normal = numpy.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
                    if normal @ triangle[0] < 0:
                        triangle, normal = triangle[::-1], -normal
                    grey = 40 + round(200 * max(0.0, unit(normal) @ light)) if is_shaded else 255
                    faces.append((numpy.array(triangle), grey))
    assert len(faces) == 80
    return faces


def write_ply(path, faces):
    lines = ["ply", "format ascii 1.0", f"element vertex {3 * len(faces)}"]
    lines += [f"property float {k}" for k in "xyz"] + [f"property uchar {k}" for k in ("red", "green", "blue")]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [f"{x:.9g} {y:.9g} {z:.9g} {grey} {grey} {grey}" for triangle, grey in faces for x, y, z in triangle]
    lines += [f"3 {3 * i} {3 * i + 1} {3 * i + 2}" for i in range(len(faces))]
    with open(path, "w") as file:
        file.write("\n".join(lines) + "\n")


def ours(program, path, samples):
    out = path + ".png"
    settings = {
        "camera.eye": ",".join(map(str, EYE)),
        "camera.target": "0,0,0",
        "camera.fov_deg": FOV_DEG,
        "background": "000",
    }
    command = [program, "render", path, "-o", out, "--style", "unlit", "--size", str(SIZE_PX), "--samples", samples]
    for key, value in settings.items():
        command += ["--set", f"{key}={value}"]
    subprocess.run(command, check=True)
    return numpy.asarray(pyvista.read(out)["PNGImage"], float).reshape(SIZE_PX, SIZE_PX, -1)[::-1, :, 0]


def vtk(path, antialiasing):
    """A picture, and the number of samples that the driver gives it."""
    plotter = pyvista.Plotter(off_screen=True, window_size=(SIZE_PX, SIZE_PX))
    plotter.set_background("black")
    plotter.add_mesh(pyvista.read(path), scalars="RGB", rgb=True, lighting=False)
    plotter.camera.position, plotter.camera.focal_point, plotter.camera.up = EYE, (0, 0, 0), (0, 1, 0)
    plotter.camera.view_angle = FOV_DEG
    plotter.renderer.ResetCameraClippingRange()
    if antialiasing == "msaa":
        plotter.enable_anti_aliasing("msaa", multi_samples=MSAA_SAMPLES)
    elif antialiasing:
        plotter.enable_anti_aliasing(antialiasing)
    else:
        plotter.disable_anti_aliasing()
        plotter.render_window.SetMultiSamples(0)
    picture = plotter.screenshot(return_img=True)
    samples = plotter.render_window.GetRenderFramebuffer().GetMultiSamples()
    plotter.close()
    return numpy.asarray(picture, float)[:, :, 0], samples


def truth(faces, blending):
    """Encoded colours, 0 to 255: areas of the faces that are seen, over black."""
    decode, encode = (to_linear, from_linear) if blending == "linear" else (lambda v: v, lambda v: v)
    picture = numpy.zeros((SIZE_PX, SIZE_PX))
    eye = numpy.array(EYE)
    ahead = -eye / numpy.linalg.norm(eye)
    right = numpy.cross(ahead, (0.0, 1.0, 0.0))
    right /= numpy.linalg.norm(right)
    down = numpy.cross(ahead, right)
    scale = 0.5 * SIZE_PX / math.tan(math.radians(FOV_DEG / 2))
    for triangle, grey in faces:
        # As float32, which the file has.
        triangle = triangle.astype(numpy.float32).astype(float)
        normal = numpy.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        if normal @ (eye - triangle[0]) <= 0:
            continue
        place = lambda p: (0.5 * SIZE_PX + scale * (right @ p) / (ahead @ p), 0.5 * SIZE_PX + scale * (down @ p) / (ahead @ p))
        add_areas(picture, [place(p - eye) for p in triangle], decode(grey / 255))
    return 255 * encode(picture)


def add_areas(picture, polygon, color):
    """Adds a colour, times the area of a convex polygon in each pixel."""
    ys = [y for _, y in polygon]
    for row in range(max(0, math.floor(min(ys))), min(SIZE_PX, math.floor(max(ys)) + 1)):
        strip = clipped(clipped(polygon, 1, row, 1), 1, row + 1, -1)
        if len(strip) < 3:
            continue
        xs = [x for x, _ in strip]
        for column in range(max(0, math.floor(min(xs))), min(SIZE_PX, math.floor(max(xs)) + 1)):
            picture[row, column] += color * area(clipped(clipped(strip, 0, column, 1), 0, column + 1, -1))


def clipped(polygon, axis, at, sign):
    """The part of a polygon on one side of a line along an axis (Sutherland and Hodgman 1974)."""
    out = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1]):
        a, b = sign * (p[axis] - at), sign * (q[axis] - at)
        if a >= 0:
            out.append(p)
        if a * b < 0:
            t = a / (a - b)
            out.append(tuple(p[k] + t * (q[k] - p[k]) for k in (0, 1)))
    return out


def area(polygon):
    pairs = zip(polygon, polygon[1:] + polygon[:1])
    return abs(sum(p[0] * q[1] - q[0] * p[1] for p, q in pairs)) / 2


def to_linear(v):
    return numpy.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def from_linear(v):
    return numpy.where(v <= 0.0031308, 12.92 * v, 1.055 * numpy.maximum(v, 0) ** (1 / 2.4) - 0.055)


def errors(picture, want, decode):
    """RMSE and largest error of the pixels that either touches, in the scale of blending, and the mean FLIP of all."""
    counts = (picture > 0) | (want > 0)
    away = 255 * numpy.abs(decode(picture / 255) - decode(want / 255))[counts]
    as_colors = lambda v: numpy.repeat((v / 255).astype(numpy.float32)[:, :, None], 3, axis=2)
    _, flip, _ = evaluate(as_colors(want), as_colors(picture), "LDR")
    return math.sqrt(numpy.mean(away**2)), away.max(), flip


if __name__ == "__main__":
    main()
