"""Cost of the program's edges: see tests/bench/peers/run --edges.

Start: a process that draws a cube, from its start to its exit, less the stages that it reports itself (read, parse,
plan, render, encode). What remains is the start of the program, its threads and its file.

Batch: 300 small meshes in one call of meshsnap, and in 300 calls of F3D on a display that is up already. All pictures
have 256 x 256 px. Rounds are interleaved, and figures are medians.
"""

import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

SIZE_PX = 256
MESHES = 300
ROUNDS = 100
BATCH_ROUNDS = 5
F3D_CALLS = 30
START_MS_MAX = 5
BATCH_RATIO_MIN = 50
STAGES = ("read", "parse", "plan", "render", "encode")


def main():
    program = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        names = made(folder)
        above = start(program, os.path.join(folder, names[0]))
        met = above <= START_MS_MAX
        ratio = batch(program, folder, names)
        met = met and (ratio is None or ratio >= BATCH_RATIO_MIN)
    sys.exit(0 if met else 1)


def made(folder):
    """Boxes, each of another shape, as OBJ."""
    names = []
    for i in range(MESHES):
        corners = [(x * (1 + i / MESHES), y, z * (2 - i / MESHES)) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
        text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {face}\n" for face in faces)
        names.append(f"box{i:03}.obj")
        with open(os.path.join(folder, names[-1]), "w") as file:
            file.write(text)
    return names


def timed(command, folder, environment=None):
    began = time.perf_counter()
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    took = 1e3 * (time.perf_counter() - began)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}: {done.stderr}")
    return took, done


def start(program, mesh):
    folder = os.path.dirname(mesh)
    draw = [program, "render", mesh, "-o", "start.png", "--backend", "cpu", "--size", str(SIZE_PX), "--explain"]
    wholes, aboves, empties = [], [], []
    for _ in range(ROUNDS + 1):
        whole, done = timed(draw, folder)
        said = done.stdout + done.stderr
        stages = {name: float(ms) for name, ms in re.findall(r"^(\w+) +([\d.]+) ms$", said, re.M)}
        wholes.append(whole)
        aboves.append(whole - sum(stages[name] for name in STAGES))
        # A process that does nothing, as this script measures it.
        empties.append(timed(["/bin/true"], folder)[0])
    # The first round warms up.
    whole, above, empty = (statistics.median(ms[1:]) for ms in (wholes, aboves, empties))
    above -= empty
    print(f"process start to exit {whole:.2f} ms, of which the measurement of an empty process {empty:.2f} ms")
    print(f"above the stages {above:.2f} ms, goal at most {START_MS_MAX} ms")
    return above


def batch(program, folder, names):
    one_call = [program, "render", *names, "-o", "pictures/", "--backend", "cpu", "--size", str(SIZE_PX)]
    ours = [timed(one_call, folder)[0] for _ in range(BATCH_ROUNDS + 1)][1:]
    drawn = len(os.listdir(os.path.join(folder, "pictures")))
    if drawn != MESHES:
        raise SystemExit(f"{drawn} pictures of {MESHES}")
    print(f"{MESHES} meshes in one call: {statistics.median(ours):.0f} ms")
    if not (shutil.which("f3d") and shutil.which("Xvfb")):
        print("F3D or Xvfb is not here, so the batch was not compared")
        return None
    display = subprocess.Popen(["Xvfb", ":97", "-screen", "0", "800x600x24"], stderr=subprocess.DEVNULL)
    time.sleep(1)
    try:
        environment = dict(os.environ, DISPLAY=":97")
        size = f"{SIZE_PX},{SIZE_PX}"
        call = lambda name: ["f3d", name, "--output", "f3d.png", "--resolution", size, "--no-background"]
        theirs = [timed(call(name), folder, environment)[0] for name in names[: F3D_CALLS + 1]][1:]
    finally:
        display.terminate()
        display.wait()
    all_calls = MESHES * statistics.median(theirs)
    ratio = all_calls / statistics.median(ours)
    print(f"F3D: {statistics.median(theirs):.0f} ms a call, {all_calls / 1e3:.1f} s for {MESHES}")
    print(f"ratio {ratio:.0f}, goal at least {BATCH_RATIO_MIN}")
    return ratio


main()
