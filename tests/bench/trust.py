#!/usr/bin/env python3
"""Proofs that a server can be trusted: it is killed, flooded, stalled, hung up on, and its disk taken away.

    tests/bench/trust.py [--program target/release/meshsnap] [--scale 0.1] [kill overload fair slow hangups disk]

Prints what it counted, and ends with 1 if a promise was broken. Needs Python 3.10 and Linux; `disk` needs root.
With --scale 1 (the default) it takes about ten minutes.
"""

import argparse
import asyncio
import hashlib
import http.client
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

CUBE = (
    b"v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
    b"f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
)
broken = []


def promise(holds, text):
    """Prints a promise, and notes it if it is broken."""
    print(f"  {'ok    ' if holds else 'BROKEN'} {text}")
    if not holds:
        broken.append(text)


class Server:
    """A server on a free port."""

    def __init__(self, program, *arguments, data=None, variables=None):
        environment = {key: value for key, value in os.environ.items() if not key.startswith("MESHSNAP_")}
        environment |= variables or {}
        command = [program, "serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--log", "error"]
        command += ["--data-dir", str(data)] if data else ["--ephemeral"]
        self.process = subprocess.Popen(
            [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        line = self.process.stdout.readline().decode()
        if not line.startswith("listening on http://"):
            sys.exit(f"the server did not start: {line!r}")
        self.host, port = line.split("//")[1].strip().rsplit(":", 1)
        self.port = int(port)

    def ask(self, method, path, body=None, headers=None, timeout=60):
        connection = http.client.HTTPConnection(self.host, self.port, timeout=timeout)
        try:
            connection.request(method, path, body, headers or {})
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def load(self):
        return json.loads(self.ask("GET", "/v1/capabilities")[1])["load"]

    def is_idle(self):
        """Nothing waits, runs, or has memory but what is kept."""
        text = self.ask("GET", "/metrics")[1].decode()
        held = re.findall(r'^meshsnap_memory_bytes\{account="(?:jobs|uploads|answers)"\} (\d+)', text, re.M)
        load = self.load()
        return held == ["0"] * 3 and (load["queued"], load["running"]) == (0, 0)

    def resident_mib(self):
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", text)[1]) / 1024

    def waits(self):
        """By name of threads: seconds on a core, seconds for which they waited for one, and how often."""
        sums = {}
        for thread in Path(f"/proc/{self.process.pid}/task").iterdir():
            try:
                name = (thread / "comm").read_text().strip().split("-")[0]
                ran, stood, slices = map(int, (thread / "schedstat").read_text().split())
            except OSError:
                continue  # it has ended
            before = sums.get(name, (0, 0, 0))
            sums[name] = (before[0] + ran / 1e9, before[1] + stood / 1e9, before[2] + slices)
        return sums

    def watch_memory(self, seconds):
        """Every second, the bytes of all accounts, and the budget."""
        until, looks = time.monotonic() + seconds, []
        while time.monotonic() < until:
            text = self.ask("GET", "/metrics")[1].decode()
            accounts = [int(bytes) for bytes in re.findall(r"^meshsnap_memory_bytes\{[^}]*\} (\d+)", text, re.M)]
            looks.append((accounts, int(re.search(r"^meshsnap_memory_budget_bytes (\d+)", text, re.M)[1])))
            time.sleep(1)
        return looks

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))

    def end(self, how=signal.SIGKILL):
        self.process.send_signal(how)
        self.process.wait()
        self.process.stdout.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.end()


def percentile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def measure(server, path, seconds, pause=0.01):
    """Times of answers to one client, milliseconds, in a process of its own, so that clients here do not slow it down."""
    code = (
        "import http.client, json, sys, time\n"
        "host, port, path, seconds, pause = sys.argv[1:]\n"
        "end, times, bad = time.monotonic() + float(seconds), [], 0\n"
        "while time.monotonic() < end:\n"
        "    began = time.monotonic()\n"
        "    connection = http.client.HTTPConnection(host, int(port), timeout=60)\n"
        "    try:\n"
        "        connection.request('GET', path)\n"
        "        answer = connection.getresponse()\n"
        "        answer.read()\n"
        "        bad += answer.status != 200\n"
        "    except OSError:\n"
        "        bad += 1\n"
        "    connection.close()\n"
        "    times.append((time.monotonic() - began) * 1000)\n"
        "    time.sleep(float(pause))\n"
        "print(json.dumps([times, bad]))\n"
    )
    arguments = [server.host, str(server.port), path, str(seconds), str(pause)]
    return subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE)


def measured(process):
    times, bad = json.loads(process.communicate()[0])
    return times, bad


def kill(program, scale):
    """kill -9 at random instants in a stream of submissions: what was accepted ends once, with the right picture."""
    instants, generator = max(3, int(200 * scale)), random.Random(7)
    data = Path(tempfile.mkdtemp(prefix="meshsnap-trust-"))
    accepted, refused, cut = {}, 0, 0
    sizes = [16, 24, 32]
    with Server(program) as server:
        right = {size: server.ask("POST", f"/v1/render?size={size}", CUBE)[1] for size in sizes}
    right = {size: hashlib.sha256(picture).hexdigest() for size, picture in right.items()}

    def submit(server, size, until):
        answers = []
        while time.monotonic() < until:
            try:
                answers.append((size, *server.ask("POST", f"/v1/jobs?size={size}", CUBE, timeout=5)))
            except (OSError, http.client.HTTPException):
                answers.append((size, 0, b""))
                break
        return answers

    for _ in range(instants):
        server = Server(program, "--workers", "2", "--result-count", "1000000", "--result-bytes", "1GiB", data=data)
        with ThreadPoolExecutor(len(sizes)) as pool:
            submitting = [pool.submit(submit, server, size, time.monotonic() + 0.6) for size in sizes]
            time.sleep(generator.uniform(0.0, 0.5))
            server.end()
            for size, status, body in (answer for future in submitting for answer in future.result()):
                if status == 202:
                    accepted[json.loads(body)["id"]] = size
                elif status == 0:
                    cut += 1
                else:
                    refused += 1
    ends, wrong = {}, 0
    # All results stay until they are looked at.
    roomy = ["--result-count", "1000000", "--result-bytes", "1GiB"]
    with Server(program, "--workers", "2", *roomy, data=data) as server:
        for job, size in accepted.items():
            status, body = server.ask("GET", f"/v1/jobs/{job}", headers={"Prefer": "wait=60"})
            state = json.loads(body).get("state") if status == 200 else f"status {status}"
            ends[state] = ends.get(state, 0) + 1
            picture = server.ask("GET", f"/v1/jobs/{job}/result")[1]
            wrong += hashlib.sha256(picture).hexdigest() != right[size]
    shutil.rmtree(data)
    print(f"  {instants} kills, {len(accepted)} accepted, {refused} refused, {cut} cut off; ends: {ends}")
    promise(ends == {"done": len(accepted)} and len(accepted) > instants, "every accepted job is done")
    promise(wrong == 0, f"with the right picture ({wrong} wrong)")


async def flood(server, seconds, clients, paths):
    """Many clients that ask again at once. Returns how often each status was answered."""
    statuses, until = {}, time.monotonic() + seconds

    async def client(index):
        path = paths[index % len(paths)]
        head = f"POST {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: {len(CUBE)}\r\n\r\n"
        while time.monotonic() < until:
            status = "none"
            try:
                reader, writer = await asyncio.open_connection(server.host, server.port)
                writer.write(head.encode() + CUBE)
                answer = await asyncio.wait_for(reader.read(), 60)
                status = answer[9:12].decode() or "none"
                writer.close()
            except (OSError, asyncio.TimeoutError):
                pass
            statuses[status] = statuses.get(status, 0) + 1

    await asyncio.gather(*(client(index) for index in range(clients)))
    return statuses


def overload(program, scale):
    """Ten times the queue's capacity: refusals, health at once, no 5xx, memory that does not grow."""
    seconds = max(10, 120 * scale)
    # Connections are not what is scarce here: all clients have one address.
    arguments = ["--workers", "2", "--queue", "8", "--result-ttl-ms", "1s", "--unfetched-ttl-ms", "1s"]
    with Server(program, *arguments, "--connections", "4096", "--connections-per-address", "4096") as server:
        idle, _ = measured(measure(server, "/healthz", 2))
        before = server.resident_mib()
        health, waits, held = measure(server, "/healthz", seconds), server.waits(), []
        watching = threading.Thread(target=lambda: held.extend(server.watch_memory(seconds)))
        watching.start()
        statuses = asyncio.run(flood(server, seconds, 160, ["/v1/jobs?size=64", "/v1/render?size=64"]))
        times, bad = measured(health)
        watching.join()
        after, waited = server.resident_mib(), server.waits()
    print(f"  {seconds:.0f} s, 160 clients: {dict(sorted(statuses.items()))}")
    print(f"  /healthz p99 {percentile(times, 0.99):.1f} ms ({percentile(idle, 0.99):.1f} idle), {len(times)} answers")
    print(f"  resident {before:.0f} MiB before, {after:.0f} MiB after")
    most = max(sum(accounts) / budget for accounts, budget in held)
    print(f"  at most {100 * most:.1f} % of the memory that the server gives itself, of {len(held)} looks")
    promise(most <= 1 and after < before + 256, "memory within the budget")
    for name in ("http", "render", "raster"):
        ran, stood, slices = (now - then for now, then in zip(waited.get(name, (0,) * 3), waits.get(name, (0,) * 3)))
        print(f"  threads {name}: {ran:.1f} s on a core, {stood:.1f} s waiting for one, {1000 * stood / max(1, slices):.1f} ms each time")
    promise(bad == 0 and percentile(times, 0.99) < 50, "health is answered, p99 under 50 ms")
    promise(not any(status.startswith("5") or status == "none" for status in statuses), "no 5xx, nothing unanswered")
    promise(statuses.get("429", 0) > 0 and statuses.get("202", 0) > 0, "some is refused, some accepted")


def fair(program, scale):
    """Thumbnails beside a client that keeps all workers busy with jobs: p99 within three times of idle."""
    seconds = max(6, 20 * scale)
    with Server(program, "--workers", "2", "--picture-bytes", "0") as server:
        server.ask("POST", "/v1/meshes", CUBE)
        path = f"/v1/meshes/{hashlib.sha256(CUBE).hexdigest()}/render.png?size=64"
        server.ask("GET", path)
        idle, _ = measured(measure(server, path, seconds))
        statuses, stop = {}, threading.Event()

        def submit():
            while not stop.is_set():
                status = server.ask("POST", "/v1/jobs?size=512", CUBE)[0]
                statuses[status] = statuses.get(status, 0) + 1
                time.sleep(0.002 if status == 202 else 0.1)

        submitting = threading.Thread(target=submit)
        submitting.start()
        time.sleep(2)
        busy, bad = measured(measure(server, path, seconds))
        waiting = server.load()["queued"]
        stop.set()
        submitting.join()
    print(f"  p99 {percentile(idle, 0.99):.1f} ms idle, {percentile(busy, 0.99):.1f} ms beside jobs ({statuses}, {waiting} wait)")
    promise(bad == 0 and waiting > 0 and statuses.get(202, 0) > 20, "jobs wait, and thumbnails are answered")
    promise(percentile(busy, 0.99) < 3 * max(percentile(idle, 0.99), 3), "p99 within three times of idle")


async def stalled(server, count, while_open):
    """Opens connections that dribble headers or bodies, do not read, or are silent, and awaits `while_open`."""
    kinds = [
        b"GET /healthz HTTP/1.1\r\nHost: loc",
        b"POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\nv 0",
        b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n" * 40,
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + b"\0\0\0\4\0\0\0\0\0",
    ]
    writers, opened = [], 0
    for index in range(count):
        try:
            _, writer = await asyncio.open_connection(server.host, server.port, limit=1)
            writer.write(kinds[index % len(kinds)])
            writers.append(writer)
            opened += 1
        except OSError:
            pass
    result = await asyncio.to_thread(while_open)
    for writer in writers:
        writer.close()
    return opened, result


def slow(program, scale):
    """Slow connections: headers, bodies, readers and silent HTTP/2. A healthy client hardly notices."""
    count = max(100, int(2000 * scale))
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    wanted = 2 * count + 200
    if most != resource.RLIM_INFINITY and most < wanted:
        sys.exit(f"slow needs {wanted} file descriptors, and the limit is {most}: raise it with ulimit -Hn")
    resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
    with Server(program, "--connections", "4096", "--connections-per-address", "4096") as server:
        server.ask("POST", "/v1/meshes", CUBE)
        path = f"/v1/meshes/{hashlib.sha256(CUBE).hexdigest()}/render.png?size=32"
        server.ask("GET", path)
        before = server.descriptors()
        # Without, with, without: what the machine does meanwhile is seen in the difference of the first and the last.
        idle, _ = measured(measure(server, path, 4))
        held = []

        def healthy():
            held.append(server.descriptors())
            return measured(measure(server, path, 6))

        opened, (times, bad) = asyncio.run(stalled(server, count, healthy))
        time.sleep(2)
        again, _ = measured(measure(server, path, 4))
        left = server.descriptors()
    usual = max(percentile(idle, 0.99), percentile(again, 0.99))
    print(f"  {opened} slow connections, {held[0] - before} held by the server, {left - before} two seconds after their end")
    print(f"  p50 {percentile(idle, 0.5):.1f} -> {percentile(times, 0.5):.1f} -> {percentile(again, 0.5):.1f} ms, "
          f"p99 {percentile(idle, 0.99):.1f} -> {percentile(times, 0.99):.1f} -> {percentile(again, 0.99):.1f} ms "
          f"({len(idle)}, {len(times)} and {len(again)} answers)")
    promise(opened == count and held[0] - before > count * 0.7, "they are held")
    promise(bad == 0 and len(times) > 50, "a healthy client is always answered")
    promise(percentile(times, 0.99) < 2 * max(5, usual), "p99 less than doubled (or under 10 ms)")
    promise(left - before < 20, "nothing stays of them")


async def hang_up(server, count):
    def head(path, length=len(CUBE)):
        return f"POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\r\n".encode()

    small, large = head("/v1/render?size=64"), head("/v1/render?size=1024&samples=16")
    # The bytes that are sent, the bytes of the answer that are read, and the time after which the client is gone.
    phases = {
        "within the header": (small[:30], 0, 0.0),
        "within the body": (small + CUBE[:40], 0, 0.002),
        "after the body": (small + CUBE, 0, 0.0),
        "while it waits": (large + CUBE, 0, 0.002),
        "while it is drawn": (large + CUBE, 0, 0.02),
        "within the answer": (small + CUBE, 20, 0.0),
        "as a mesh is stored": (head("/v1/meshes") + CUBE, 0, 0.001),
        "as a verdict is made": (head("/v1/check") + CUBE, 0, 0.001),
        "as an event stream": (b"GET /v1/jobs/0/events HTTP/1.1\r\nHost: localhost\r\n\r\n", 1, 0.0),
        "within a large upload": (head("/v1/render", 20_000_000) + b"#" * 200_000, 0, 0.005),
    }

    async def one(index):
        sent, reads, pause = list(phases.values())[index % len(phases)]
        reader, writer = await asyncio.open_connection(server.host, server.port)
        writer.write(sent)
        if reads:
            await reader.read(reads)
        await asyncio.sleep(pause)
        writer.transport.abort()

    for index in range(0, count, 20):
        await asyncio.gather(*(one(index + offset) for offset in range(20)))
    return list(phases)


def torus(count):
    """A torus of so many quads around and along."""
    angles = [2 * math.pi * i / count for i in range(count)]
    vertices = [
        f"v {(2 + math.cos(b)) * math.cos(a):.6f} {(2 + math.cos(b)) * math.sin(a):.6f} {math.sin(b):.6f}"
        for a in angles for b in angles
    ]
    def place(i, j):
        return i % count * count + j % count + 1
    faces = [
        f"f {place(i, j)} {place(i + 1, j)} {place(i + 1, j + 1)} {place(i, j + 1)}"
        for i in range(count) for j in range(count)
    ]
    return "\n".join(vertices + faces).encode()


# Work of many kinds: paths, and whether the mesh is one of a million triangles or of 80,000.
LONG_WORK = [
    ("/v1/render?size=512", True),
    ("/v1/render?size=512&style=technical", True),
    ("/v1/render?size=512&style=outline", True),
    ("/v1/render?size=512&style=wire", True),
    ("/v1/render?size=1024&style=xray", True),
    ("/v1/check?rules=opens,watertight,manifold,no-self-intersection", True),
    ("/v1/render?size=4096&style=clay&samples=16", False),
    ("/v1/render?size=4096&format=jpeg", False),
    ("/v1/render?size=4096&image.effort=9", False),
    ("/v1/render?size=2048&samples=adaptive", False),
]


def times_to_free(server, path, body, count):
    """Times until the one worker is free after its client has hung up at some moment, milliseconds: of the clock, or of
    the server's threads on a core if that is less. Where other programs share the cores, the clock measures those."""
    began = time.monotonic()
    if server.ask("POST", path, body)[0] != 200:
        sys.exit(f"{path} is not answered")
    whole, times, generator = time.monotonic() - began, [], random.Random(11)

    def spent():
        return sum(ran for ran, _, _ in server.waits().values())

    for attempt in range(4 * count):
        if len(times) == count:
            break
        connection = http.client.HTTPConnection(server.host, server.port)
        # Another mesh each time: verdicts on one are kept.
        connection.request("POST", path, body + b"\n# %d" % attempt)
        began = time.monotonic()
        while server.load()["running"] == 0 and time.monotonic() - began < whole:
            pass
        time.sleep(generator.random() * whole * 0.9)
        if server.load()["running"] == 0:
            continue
        on_cores, began = spent(), time.monotonic()
        connection.close()
        while server.load()["running"] != 0:
            pass
        times.append(1000 * min(time.monotonic() - began, spent() - on_cores))
    if len(times) < count / 2:
        sys.exit(f"{path} was hardly ever found running")
    return times


def hangups(program, scale):
    """Clients that hang up in each phase: places, descriptors, memory and files come back."""
    count = max(100, int(1000 * scale) // 20 * 20)
    with Server(program, "--workers", "1") as server:
        meshes, times = {True: torus(700), False: torus(200)}, []
        for path, is_large in LONG_WORK:
            of_path = times_to_free(server, path, meshes[is_large], max(4, int(20 * scale)))
            print(f"  {path}: free after {percentile(of_path, 0.5):.0f} ms in the middle, {max(of_path):.0f} at most")
            times += of_path
    print(f"  a worker is free after {percentile(times, 0.5):.0f} ms in the middle, {max(times):.0f} ms at most, of {len(times)}")
    promise(max(times) < 100, "always within 100 ms")
    data = Path(tempfile.mkdtemp(prefix="meshsnap-trust-"))
    with Server(program, "--workers", "2", "--queue", "500", "--connections", "4096", data=data) as server:
        asyncio.run(hang_up(server, 200))
        time.sleep(1)
        descriptors, memory, files = server.descriptors(), server.resident_mib(), sum(1 for _ in data.rglob("*"))
        phases = asyncio.run(hang_up(server, count))
        began = time.monotonic()
        while not server.is_idle() and time.monotonic() - began < 10:
            time.sleep(0.005)
        took = time.monotonic() - began
        time.sleep(1)
        print(f"  {count} hang-ups in {len(phases)} phases: nothing is held after {took * 1000:.0f} ms; descriptors "
              f"{descriptors} -> {server.descriptors()}; resident {memory:.0f} -> {server.resident_mib():.0f} MiB; files "
              f"{files} -> {sum(1 for _ in data.rglob('*'))}")
        promise(server.is_idle() and took < 1, "no work, no upload and no answer is left")
        promise(abs(server.descriptors() - descriptors) <= 4, "descriptors are back")
        promise(server.resident_mib() - memory < 20, "memory is back")
        promise(sum(1 for _ in data.rglob("*")) <= files, "no files are left")
        promise(server.ask("POST", "/v1/render?size=32", CUBE)[0] == 200, "the next client is served")
    shutil.rmtree(data)


def disk(program, _):
    """A disk that is full: 507 for what is stored, health and drawing as ever, recovery without a restart."""
    data = Path(tempfile.mkdtemp(prefix="meshsnap-trust-"))
    mount = ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(data)]
    if subprocess.run(mount, stderr=subprocess.DEVNULL).returncode != 0:
        print("  skipped: no leave to mount a file system")
        return
    try:
        with Server(program, data=data) as server:
            def told():
                return [problem["code"] for problem in json.loads(server.ask("GET", "/readyz")[1]).get("problems", [])]

            def recovers():
                began = time.monotonic()
                while time.monotonic() - began < 20:
                    if server.ask("POST", "/v1/jobs?size=16", CUBE)[0] == 202 and told() == []:
                        return True
                    time.sleep(0.1)
                return False

            large = CUBE + b"\n" * 300_000
            promise(server.ask("POST", "/v1/jobs?size=16", CUBE)[0] == 202, "jobs are accepted")
            filler = data / "filler"
            try:
                filler.write_bytes(b"x" * shutil.disk_usage(data).free)
            except OSError:
                pass
            statuses = {server.ask("POST", "/v1/jobs?size=16", large + bytes([65 + index]))[0] for index in range(5)}
            health = {server.ask("GET", path)[0] for path in ("/healthz", "/readyz")}
            drawn = server.ask("POST", "/v1/render?size=16", CUBE)[0]
            problems = told()
            print(f"  jobs {statuses}, health {health}, render {drawn}, /readyz tells {problems}")
            promise(statuses == {507} and health == {200} and drawn == 200, "507 for jobs alone")
            promise(problems == ["storage_full"], "/readyz says so")
            filler.unlink()
            promise(recovers(), "it recovers without a restart")
    finally:
        subprocess.run(["umount", str(data)])
        data.rmdir()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/meshsnap")
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("proofs", nargs="*")
    arguments = parser.parse_args()
    proofs = {proof.__name__: proof for proof in (kill, overload, fair, slow, hangups, disk)}
    for name in arguments.proofs or proofs:
        print(f"{name}: {proofs[name].__doc__.split(':')[0]}", flush=True)
        proofs[name](str(Path(arguments.program).resolve()), arguments.scale)
    print(f"{len(broken)} promises broken")
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
