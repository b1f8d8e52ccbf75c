#!/usr/bin/env python3
"""A server under 80 % of the load that it can take, for half an hour, with all that clients do to it: memory does not grow.

    tests/bench/soak.py [--program target/release/meshsnap] [--minutes 30] [--samples FILE.csv]

First it measures how many requests a second the server answers, then it sends four fifths of that: pictures, thumbnails of
stored meshes, jobs that are fetched and others that are not, verdicts, differences, uploads and deletions, broken meshes
and requests, clients that hang up, dribble and do not read, event streams, webhooks. Memory is taken every second; the first
sixth of the time is for warming up. Ends with 1 if what follows shows a slope over 1 MB an hour, by two standard errors,
if an answer is a 5xx, or if descriptors stay. Needs Python 3.10 and Linux.
"""

import argparse
import base64
import hashlib
import http.client
import json
import math
import random
import shutil
import socket
import statistics
import sys
import tempfile
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from trust import CUBE, Server, broken, percentile, promise

# Caches are full within minutes, so that what grows afterwards is no cache.
ARGUMENTS = [
    "--workers", "2", "--queue", "32", "--connections", "512", "--connections-per-address", "512",
    "--result-ttl-ms", "5s", "--unfetched-ttl-ms", "20s", "--mesh-count", "40", "--picture-bytes", "4MiB",
    "--resident-bytes", "16MiB", "--header-timeout-ms", "3s", "--webhooks-to-private",
]
SECRET = "whsec_" + base64.b64encode(b"0" * 32).decode()
SLOPE_MAX = 1.0
CLIENTS = 24


def mesh(seed):
    """A grid of hills: some thousand triangles, another one for each seed."""
    generator, size = random.Random(seed), 40
    lines = [f"v {x} {y} {generator.random():.4f}" for y in range(size) for x in range(size)]
    for y in range(size - 1):
        for x in range(size - 1):
            corner = y * size + x + 1
            lines.append(f"f {corner} {corner + 1} {corner + size + 1} {corner + size}")
    return "\n".join(lines).encode()


MESHES = [mesh(seed) for seed in range(60)]


class Receiver(BaseHTTPRequestHandler):
    """Takes webhooks, three times of four."""

    taken = 0

    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        Receiver.taken += 1
        self.send_response(500 if Receiver.taken % 4 == 0 else 204)
        self.end_headers()

    def log_message(self, *_):
        pass


class Client:
    """One of the clients, and what it does."""

    def __init__(self, server, hook, seed):
        self.server, self.hook, self.random = server, hook, random.Random(seed)
        self.statuses, self.times = {}, {}
        # By how often each is done.
        self.deeds = {
            self.render: 30, self.thumbnail: 30, self.job: 12, self.unfetched: 6, self.hooked: 2, self.judge: 4,
            self.compare: 2, self.store: 5, self.wrong: 6, self.hang_up: 6, self.dribble: 1, self.follow: 2,
            self.look: 6,
        }

    def ask(self, method, path, body=None, headers=None):
        status, answer = self.server.ask(method, path, body, headers)
        self.statuses[status] = self.statuses.get(status, 0) + 1
        return status, answer

    def act(self):
        deed = self.random.choices(list(self.deeds), list(self.deeds.values()))[0]
        began = time.monotonic()
        try:
            deed()
        except (OSError, http.client.HTTPException) as error:
            name = type(error).__name__
            self.statuses[name] = self.statuses.get(name, 0) + 1
        self.times.setdefault(deed.__name__, []).append((time.monotonic() - began) * 1000)

    def some_mesh(self):
        return self.random.choice(MESHES)

    def query(self):
        style = self.random.choice(["auto", "flat", "wire", "outline", "technical", "xray", "clay", "topology"])
        size = self.random.choice([64, 128, 256, 512])
        return f"style={style}&size={size}&format={self.random.choice(['png', 'webp', 'jpeg'])}"

    def render(self):
        self.ask("POST", f"/v1/render?{self.query()}", self.some_mesh())

    def thumbnail(self):
        digest = hashlib.sha256(self.some_mesh()).hexdigest()
        angle = self.random.randrange(0, 360, 5)
        status, _ = self.ask("GET", f"/v1/meshes/{digest}/render.png?size=64&camera.azimuth_deg={angle}")
        if status == 404:
            self.store()

    def job(self):
        status, answer = self.ask("POST", f"/v1/jobs?{self.query()}", self.some_mesh())
        if status == 202:
            path = f"/v1/jobs/{json.loads(answer)['id']}"
            self.ask("GET", path, headers={"Prefer": "wait=20"})
            self.ask("GET", f"{path}/result")

    def unfetched(self):
        key = f"{self.random.random()}"
        for _ in range(2):
            self.ask("POST", "/v1/jobs?size=64", MESHES[0], {"Idempotency-Key": key})

    def hooked(self):
        self.ask("POST", "/v1/jobs?size=32", CUBE, {"Webhook": self.hook})

    def judge(self):
        self.ask("POST", "/v1/check?rules=opens,watertight,manifold,no-self-intersection", self.some_mesh())

    def compare(self):
        mark = "soak-boundary"
        parts = [("a", self.some_mesh()), ("b", self.some_mesh())]
        head = 'Content-Disposition: form-data; name="{0}"; filename="{0}.obj"'
        body = b"".join(
            f"--{mark}\r\n{head.format(name)}\r\n\r\n".encode() + part + b"\r\n" for name, part in parts
        ) + f"--{mark}--\r\n".encode()
        self.ask("POST", "/v1/diff", body, {"Content-Type": f"multipart/form-data; boundary={mark}"})

    def store(self):
        body = self.some_mesh()
        self.ask("POST", "/v1/meshes", body)
        if self.random.random() < 0.1:
            self.ask("DELETE", f"/v1/meshes/{hashlib.sha256(body).hexdigest()}")

    def wrong(self):
        body = self.some_mesh()
        cut = bytearray(body[: self.random.randrange(len(body))])
        for _ in range(8):
            if cut:
                cut[self.random.randrange(len(cut))] = self.random.randrange(256)
        path = self.random.choice(["/v1/render?size=64", "/v1/render?wire.colour=1", "/v1/jobs/0", "/nothing", "/v1/render?size=99999"])
        self.ask("POST", path, bytes(cut))

    def hang_up(self):
        body = self.some_mesh()
        head = f"POST /v1/render?{self.query()} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(body)}\r\n\r\n"
        sent = head.encode() + body
        with socket.create_connection((self.server.host, self.server.port)) as connection:
            connection.sendall(sent if self.random.random() < 0.5 else sent[: self.random.randrange(len(sent))])
            time.sleep(self.random.random() * 0.02)

    def dribble(self):
        kinds = [b"GET /healthz HTTP/1.1\r\nHost: loc", b"GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n" * 20]
        with socket.create_connection((self.server.host, self.server.port)) as connection:
            connection.sendall(self.random.choice(kinds))
            time.sleep(0.5)

    def follow(self):
        status, answer = self.ask("POST", "/v1/jobs?size=128", self.some_mesh())
        if status == 202:
            self.ask("GET", f"/v1/jobs/{json.loads(answer)['id']}/events")

    def look(self):
        self.ask("GET", self.random.choice(["/healthz", "/readyz", "/metrics", "/v1/capabilities", "/openapi.json", "/"]))


def run(clients, seconds, rate, watch=lambda: None):
    """Lets clients act for a while, so many times a second in all (None: as often as they can). Returns the number."""
    until, lock, state = time.monotonic() + seconds, threading.Lock(), {"due": time.monotonic(), "count": 0}

    def live(client):
        while True:
            with lock:
                due = state["due"] if rate else time.monotonic()
                if max(due, time.monotonic()) >= until:
                    return
                # What could not be sent in time is not made up for: the load stays what it is meant to be.
                state["due"] = max(due, time.monotonic() - 1) + client.random.expovariate(rate) if rate else due
                state["count"] += 1
            time.sleep(max(0.0, due - time.monotonic()))
            client.act()

    threads = [threading.Thread(target=live, args=(client,)) for client in clients]
    for thread in threads:
        thread.start()
    while time.monotonic() < until:
        watch()
        time.sleep(1)
    for thread in threads:
        thread.join()
    return state["count"]


def slope(samples):
    """Megabytes an hour, and the standard error: the line of least squares through the medians of minutes."""
    minutes = {}
    for at, mib in samples:
        minutes.setdefault(int(at // 60), []).append(mib * 1.048576)
    hours = [minute / 60 for minute in minutes]
    medians = [statistics.median(values) for values in minutes.values()]
    if len(hours) < 3:
        return float("nan"), float("nan")
    line = statistics.linear_regression(hours, medians)
    left = [value - line.slope * hour - line.intercept for hour, value in zip(hours, medians)]
    spread = math.sqrt(sum(rest * rest for rest in left) / (len(hours) - 2))
    return line.slope, spread / (statistics.pstdev(hours) * math.sqrt(len(hours)))


def soak(program, minutes, samples_file):
    data = Path(tempfile.mkdtemp(prefix="meshsnap-soak-"))
    receiver = ThreadingHTTPServer(("127.0.0.1", 0), Receiver)
    threading.Thread(target=receiver.serve_forever, daemon=True).start()
    hook = f"http://127.0.0.1:{receiver.server_port}/"
    with Server(program, *ARGUMENTS, data=data, variables={"MESHSNAP_WEBHOOK_SECRET": SECRET}) as server:
        clients = [Client(server, hook, seed) for seed in range(CLIENTS)]
        seconds = min(20, minutes * 6)
        rate = 0.8 * run(clients, seconds, None) / seconds
        print(f"  {rate / 0.8:.0f} deeds a second at most; {rate:.0f} from now on", flush=True)
        clients = [Client(server, hook, CLIENTS + seed) for seed in range(CLIENTS)]
        began, samples, descriptors = time.monotonic(), [], server.descriptors()

        def watch():
            samples.append((time.monotonic() - began, server.resident_mib()))
            if samples_file:
                samples_file.write(f"{samples[-1][0]:.1f},{samples[-1][1]:.3f},{server.descriptors()}\n")
                samples_file.flush()

        count = run(clients, minutes * 60, rate, watch)
        wait_until = time.monotonic() + 30
        while not server.is_idle() and time.monotonic() < wait_until:
            time.sleep(0.5)
        time.sleep(5)
        idle, left = server.is_idle(), server.descriptors()
    receiver.shutdown()
    shutil.rmtree(data)
    statuses, times = {}, {}
    for client in clients:
        for status, number in client.statuses.items():
            statuses[status] = statuses.get(status, 0) + number
        for deed, values in client.times.items():
            times.setdefault(deed, []).extend(values)
    after = [sample for sample in samples if sample[0] > minutes * 10]
    grows, error = slope(after)
    print(f"  {minutes} minutes, {count} deeds; answers: {dict(sorted(statuses.items(), key=str))}; {Receiver.taken} webhooks")
    print("  p99 in ms: " + ", ".join(f"{deed} {percentile(values, 0.99):.0f}" for deed, values in sorted(times.items())))
    print(f"  resident {after[0][1]:.1f} MiB after warming up, {after[-1][1]:.1f} at the end, {max(s[1] for s in samples):.1f} "
          f"at most; {grows:+.1f} MB an hour (standard error {error:.1f}); descriptors {descriptors} -> {left}")
    # Half an hour tells a slope from noise no better than its error says: --minutes 240 does.
    promise(grows - 2 * error < SLOPE_MAX, f"memory is not seen to grow by {SLOPE_MAX} MB an hour")
    promise(not any(str(status).startswith("5") for status in statuses), "no 5xx")
    promise(count > minutes * 60 and all(times.values()), "clients were at it all the time")
    promise(idle and left <= descriptors + 4, "nothing is held at the end")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/meshsnap")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--samples", type=argparse.FileType("w"))
    arguments = parser.parse_args()
    soak(str(Path(arguments.program).resolve()), arguments.minutes, arguments.samples)
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
