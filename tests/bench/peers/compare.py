"""Run time of meshsnap, VTK and F3D on the same meshes: see tests/bench/peers/run.

Warm: the mesh is in memory, and the camera another each time. VTK renders and reads its picture back;
meshsnap's time is what its server reports for plan and render of a stored mesh (Server-Timing), with one
worker, without the rows that are encoded meanwhile. Process: from the start of a
program to its PNG file. All at 512 x 512 px; meshsnap with 4 samples, VTK and F3D as they are.
Rounds are interleaved, and figures are medians.
"""

import json
import os
import re
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import time
import urllib.request

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")
SIZE_PX = 512
WARM_ROUNDS = 15
PROCESS_ROUNDS = 5


def main():
    program = sys.argv[1]
    paths = [a for a in sys.argv[2:] if not a.startswith("--")]
    with tempfile.TemporaryDirectory() as folder:
        paths = paths or made(folder) + ["tests/data/models/spot.obj"]
        with Server(program) as server:
            warm_rows = [warm(server, path) for path in paths]
        process_rows = [process(program, path, folder) for path in paths]
    print_table("warm, ms", warm_rows)
    print_table("process start to PNG, ms", process_rows)
    if "--write" in sys.argv:
        rows = {"warm": warm_rows, "process": process_rows}
        with open("docs/peers.json", "w") as file:
            json.dump(rows, file, indent=1)
            file.write("\n")
        with open("docs/peers.svg", "w") as file:
            file.write(plot(warm_rows, process_rows))


def made(folder):
    """Bumpy tori of 80 k and 1 M triangles as binary STL."""
    import numpy

    paths = []
    for name, n in [("torus-80k.stl", 200), ("torus-1m.stl", 707)]:
        turn = numpy.arange(n + 1) * (2 * numpy.pi / n)
        u, v = turn[:, None], turn[None, :]
        tube = 0.4 + 0.03 * numpy.sin(9 * u) * numpy.cos(7 * v)
        axis = 1 + tube * numpy.cos(v)
        grid = numpy.stack([axis * numpy.cos(u), tube * numpy.sin(v), axis * numpy.sin(u)], -1).astype("<f4")
        grid[-1] = grid[0]
        grid[:, -1] = grid[:, 0]
        a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
        corners = numpy.concatenate([numpy.stack(t, 2).reshape(-1, 9) for t in ((a, b, c), (a, c, d))])
        records = numpy.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", 9), ("rest", "<u2")])
        records["corners"] = corners
        path = os.path.join(folder, name)
        with open(path, "wb") as file:
            file.write(bytes(80) + struct.pack("<I", len(corners)) + records.tobytes())
        paths.append(path)
    return paths


class Server:
    """A meshsnap server with one worker that draws on the CPU."""

    def __init__(self, program):
        command = [program, "serve", "--listen", "127.0.0.1:0", "--workers", "1", "--backend", "cpu"]
        self.child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.address = None
        for line in self.child.stdout:
            found = re.search(r"127\.0\.0\.1:(\d+)", line)
            if found:
                self.address = found.group(0)
                break
        if self.address is None:
            raise SystemExit(f"{program} serve ended without an address")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.child.terminate()
        self.child.wait()

    def store(self, mesh):
        request = urllib.request.Request(f"http://{self.address}/v1/meshes", data=mesh)
        with urllib.request.urlopen(request) as answer:
            return answer.headers["Location"]

    def render_ms(self, mesh, azimuth_deg, query):
        url = f"http://{self.address}{mesh}/render.png?size={SIZE_PX}&camera.azimuth_deg={azimuth_deg}&{query}"
        with urllib.request.urlopen(url) as answer:
            answer.read()
            timing = dict(re.findall(r"(\w+);dur=([\d.]+)", answer.headers["Server-Timing"]))
        return float(timing["plan"]) + float(timing["render"]) - float(timing.get("encode_rows", 0))


# VTK draws the edges of all triangles, 1 px wide.
LOOKS = {
    "flat": "style=flat",
    "wire": "style=wire&wire.edges=triangles&wire.thickness=1",
    "auto": "style=auto",
    "wire auto": "style=wire",
}


def warm(server, path):
    import pyvista

    mesh = pyvista.read(path)
    plotters = {}
    for edges in (False, True):
        plotter = pyvista.Plotter(off_screen=True, window_size=(SIZE_PX, SIZE_PX))
        plotter.add_mesh(mesh, show_edges=edges)
        plotter.show(auto_close=False)
        plotters[edges] = plotter
    with open(path, "rb") as file:
        stored = server.store(file.read())
    times = {}

    def took(name, ms):
        times.setdefault(name, []).append(ms)

    for turn in range(WARM_ROUNDS + 1):
        for edges, plotter in plotters.items():
            plotter.camera.azimuth += 1
            began = time.perf_counter()
            plotter.render()
            plotter.screenshot(return_img=True)
            took("VTK edges" if edges else "VTK", 1e3 * (time.perf_counter() - began))
        for name, query in LOOKS.items():
            took(name, server.render_ms(stored, 30 + turn, query))
    for plotter in plotters.values():
        plotter.close()
    # The first round warms up.
    row = {name: statistics.median(ms[1:]) for name, ms in times.items()}
    row["VTK / flat"] = row["VTK"] / row["flat"]
    row["VTK / (wire - flat)"] = row["VTK"] / max(row["wire"] - row["flat"], 1e-3)
    row["VTK edges / wire"] = row["VTK edges"] / row["wire"]
    row["VTK / auto"] = row["VTK"] / row["auto"]
    row["auto / flat"] = row["auto"] / row["flat"]
    return {"mesh": os.path.basename(path), **row}


def process(program, path, folder):
    out = os.path.join(folder, "out.png")
    size = f"{SIZE_PX},{SIZE_PX}"
    commands = {"meshsnap": [program, "render", path, "-o", out, "--size", str(SIZE_PX), "--backend", "cpu"]}
    if shutil.which("f3d") and shutil.which("xvfb-run"):
        # A display that is up already: F3D's own time counts, not Xvfb's.
        commands["F3D"] = ["f3d", path, "--output", out, "--resolution", size, "--no-background"]
    if shutil.which("stl-thumb") and path.endswith(".stl"):
        commands["stl-thumb"] = ["stl-thumb", path, out, "-s", str(SIZE_PX)]
    times = {name: [] for name in commands}
    display = None
    environment = dict(os.environ)
    if "F3D" in commands:
        display = subprocess.Popen(["Xvfb", ":97", "-screen", "0", "800x600x24"], stderr=subprocess.DEVNULL)
        environment["DISPLAY"] = ":97"
        time.sleep(1)
    try:
        for _ in range(PROCESS_ROUNDS):
            for name, command in commands.items():
                began = time.perf_counter()
                done = subprocess.run(command, env=environment, capture_output=True)
                if done.returncode == 0 and os.path.exists(out):
                    times[name].append(1e3 * (time.perf_counter() - began))
                    os.remove(out)
    finally:
        if display:
            display.terminate()
            display.wait()
    row = {name: statistics.median(ms) for name, ms in times.items() if ms}
    for peer in ("F3D", "stl-thumb"):
        if peer in row:
            row[f"{peer} / meshsnap"] = row[peer] / row["meshsnap"]
    return {"mesh": os.path.basename(path), **row}


def print_table(title, rows):
    columns = list(dict.fromkeys(name for row in rows for name in row if name != "mesh"))
    print(f"\n| {title} | " + " | ".join(columns) + " |\n|" + "---|" * (len(columns) + 1))
    for row in rows:
        cells = [f"{row[name]:.2f}" if name in row else "" for name in columns]
        print(f"| {row['mesh']} | " + " | ".join(cells) + " |")


def plot(warm_rows, process_rows):
    """Bars of time on a logarithmic axis, one group for each mesh."""
    import math

    groups = [(row["mesh"] + ", warm", [("VTK", row["VTK"]), ("VTK edges", row["VTK edges"]), ("meshsnap flat", row["flat"]), ("meshsnap wire", row["wire"])]) for row in warm_rows]
    groups += [(row["mesh"] + ", process", [(name, row[name]) for name in ("F3D", "stl-thumb", "meshsnap") if name in row]) for row in process_rows]
    colours = {"VTK": "#8c96a3", "VTK edges": "#b6bec8", "F3D": "#8c96a3", "stl-thumb": "#b6bec8"}
    lines, y = [], 30
    x = lambda ms: 210 + 130 * (math.log10(max(ms, 0.1)) + 1)
    for title, bars in groups:
        lines.append(f'<text x="10" y="{y}" font-weight="bold">{title}</text>')
        for name, ms in bars:
            y += 18
            fill = colours.get(name, "#2a6fb0")
            lines.append(f'<text x="200" y="{y + 4}" text-anchor="end">{name}</text>')
            lines.append(f'<rect x="210" y="{y - 8}" width="{x(ms) - 210:.1f}" height="14" fill="{fill}"/>')
            lines.append(f'<text x="{x(ms) + 6:.1f}" y="{y + 4}">{ms:.1f} ms</text>')
        y += 30
    body = "\n".join(lines)
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="860" height="{y}" font-family="sans-serif" font-size="12">\n<rect width="100%" height="100%" fill="#ffffff"/>\n{body}\n</svg>\n'


main()
