#!/usr/bin/env python3
"""Several servers that are one service, under faults and under load. Starts NATS, the servers and, where it is wanted, a
server of S3 on this machine, and ends with a failure if a job is lost, ends wrongly, or has other bytes than a server that
is alone draws.

    tests/bench/cluster.py kills        # a server is killed every 2 s for 60 s, NATS twice: 2,000 jobs on 4 servers
    tests/bench/cluster.py partition    # servers in namespaces of their own are cut off for 5 to 40 s (needs root)
    tests/bench/cluster.py slow-store   # a bucket whose answers take 2 s, and one of twenty of which is an error
    tests/bench/cluster.py duplicates   # 1,000 clients want 50 pictures
    tests/bench/cluster.py scaling      # 1, 2 and 4 servers, each with half a core; and what the queue costs per job

Options: --binary target/release/meshsnap, --jobs N, --seconds N, --nodes N, --nats nats-server, --keep FOLDER (logs stay there).
`slow-store` needs moto, which tests/run installs: run it by target/python/bin/python.
"""

import argparse
import concurrent.futures
import hashlib
import http.client
import json
import os
import random
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

CUBE = (b"v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
        b"f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n")


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Nats:
    def __init__(self, program, folder, host="127.0.0.1"):
        self.program, self.folder, self.host, self.port = program, folder, host, free_port()
        self.process = None
        self.start()

    def start(self):
        arguments = [self.program, "-a", self.host, "-p", str(self.port), "-js", "-sd", os.path.join(self.folder, "nats")]
        log = open(os.path.join(self.folder, "nats.log"), "ab")
        self.process = subprocess.Popen(arguments, stdout=log, stderr=log)
        wait_for_port(self.host, self.port)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def address(self):
        return f"nats://{self.host}:{self.port}/farm"


def wait_for_port(host, port):
    until = time.time() + 30
    while True:
        try:
            socket.create_connection((host, port), 1).close()
            return
        except OSError:
            if time.time() > until:
                sys.exit(f"nothing listens on {host}:{port}")
            time.sleep(0.02)


class Server:
    """A server that can be killed and started again."""

    count = 0

    def __init__(self, options, arguments, environment=None, prefix=(), listen="127.0.0.1:0"):
        self.options, self.arguments, self.environment = options, arguments, environment or {}
        self.prefix, self.listen = list(prefix), listen
        Server.count += 1
        self.log = os.path.join(options.folder, f"server-{Server.count}.log")
        self.process, self.host, self.port = None, None, None
        self.start()

    def start(self):
        command = self.prefix + [self.options.binary, "serve", "--listen", self.listen, "--backend", "cpu", "--ephemeral"]
        environment = {**os.environ, "MESHSNAP_LOG": "info", **self.environment}
        self.process = subprocess.Popen(command + self.arguments, stdout=subprocess.PIPE, stderr=open(self.log, "ab"),
                                        env=environment, text=True)
        line = self.process.stdout.readline()
        if "http://" not in line:
            sys.exit(f"a server does not start: {self.log}")
        self.host, port = line.strip().rsplit("/", 1)[1].rsplit(":", 1)
        self.port = int(port)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def ask(self, method, path, body=None, headers=None, timeout=60):
        """Status, headers and body; None if the server is away."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=timeout)
        try:
            connection.request(method, path, body=body, headers=headers or {})
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()
        except (OSError, http.client.HTTPException):
            return None
        finally:
            connection.close()

    def metric(self, name, *labels):
        answer = self.ask("GET", "/metrics")
        for line in (answer[2].decode() if answer else "").splitlines():
            if line.startswith(name) and all(label in line for label in labels):
                return float(line.rsplit(" ", 1)[1])
        return 0.0


def query(number):
    """One of a few requests that a job may have."""
    return f"style=wire&size={64 + 8 * (number % 10)}"


class Pictures:
    """The bytes that a server that is alone draws."""

    def __init__(self, options):
        self.server, self.known = Server(options, []), {}

    def of(self, path):
        if path not in self.known:
            self.known[path] = hashlib.sha256(self.server.ask("POST", f"/v1/render?{path}", CUBE)[2]).hexdigest()
        return self.known[path]


def submit(servers, number, key=None, path=None):
    """Sends a job until some server accepts it. Its address."""
    headers = {"Idempotency-Key": key} if key else {}
    while True:
        answer = random.choice(servers).ask("POST", f"/v1/jobs?{path or query(number)}", CUBE, headers)
        if answer and answer[0] == 202:
            return answer[1]["location"]
        if answer and answer[0] not in (409, 429, 503):
            sys.exit(f"a job was refused: {answer}")
        time.sleep(0.1)


def end_of(servers, job, until):
    """The end of a job; None if it has not come in time."""
    while time.time() < until:
        answer = random.choice(servers).ask("GET", job, headers={"Prefer": "wait=10"})
        if answer and answer[0] == 200:
            state = json.loads(answer[2])
            if state["state"] not in ("queued", "running"):
                return state
        elif answer and answer[0] == 404:
            return {"state": "lost"}
        else:
            time.sleep(0.1)
    return None


def check(options, servers, jobs, patience):
    """Prints how the jobs ended. True if all are right."""
    pictures, until = Pictures(options), time.time() + patience
    ends, wrong = {}, 0
    with concurrent.futures.ThreadPoolExecutor(16) as pool:
        states = list(pool.map(lambda job: end_of(servers, job, until), jobs.values()))
    for (number, job), state in zip(jobs.items(), states):
        name = state["state"] if state else "not ended"
        ends[name] = ends.get(name, 0) + 1
        if name != "done":
            print("  ", number, job, state)
            continue
        answer = None
        while not answer:
            answer = random.choice(servers).ask("GET", f"{job}/result")
        wrong += hashlib.sha256(answer[2]).hexdigest() != pictures.of(query(number))
    pictures.server.kill()
    results = len(os.listdir(os.path.join(options.folder, "store", "results"))) if options.store is None else None
    print(f"{len(jobs)} accepted: {ends}, {wrong} with other bytes than a server that is alone, {results} ends in the store")
    begun = sum(log_count(server, "a job of the shared queue ended") for server in servers)
    print(f"ends written: {begun}; the queue lost messages, which were sent again: "
          f"{sum(log_count(server, 'the queue had lost messages') for server in servers)} times")
    return ends == {"done": len(jobs)} and wrong == 0 and results in (None, len(jobs))


def log_count(server, words):
    with open(server.log, encoding="utf-8", errors="replace") as log:
        return sum(words in line for line in log)


def service(options, count, more=(), environment=None):
    nats = Nats(options.nats, options.folder)
    store = options.store
    if store is None:
        os.makedirs(os.path.join(options.folder, "store"), exist_ok=True)
        store = f"file://{options.folder}/store"
    arguments = ["--queue", nats.address(), "--store", store, *more]
    return nats, [Server(options, arguments, environment) for _ in range(count)]


def kills(options):
    nats, servers = service(options, options.nodes, ["--workers", "2"])
    jobs, over, kinds = {}, threading.Event(), {"server": 0, "nats": 0}

    def send(first):
        for number in range(first, options.jobs, 8):
            jobs[number] = submit(servers, number)
            time.sleep(options.seconds * 8 / options.jobs * random.random())

    def disturb():
        began, next_nats = time.time(), [options.seconds / 3, options.seconds * 2 / 3]
        while not over.wait(2):
            if next_nats and time.time() - began > next_nats[0]:
                next_nats.pop(0)
                nats.kill()
                time.sleep(1)
                nats.start()
                kinds["nats"] += 1
            server = random.choice(servers)
            server.kill()
            server.start()
            kinds["server"] += 1
            if time.time() - began > options.seconds:
                return

    disturbing = threading.Thread(target=disturb)
    disturbing.start()
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        list(pool.map(send, range(8)))
    disturbing.join()
    print(f"killed: {kinds}; redelivered messages now: {servers[0].metric('meshsnap_shared_queue_messages', 'redelivered'):.0f}")
    return check(options, servers, dict(sorted(jobs.items())), 180)


RUNS = {"kills": kills}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("run", choices=RUNS)
    parser.add_argument("--binary", default="target/release/meshsnap")
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--nodes", type=int, default=4)
    parser.add_argument("--nats", default=shutil.which("nats-server") or "/usr/sbin/nats-server")
    parser.add_argument("--keep")
    options = parser.parse_args()
    options.binary, options.store = os.path.abspath(options.binary), None
    options.folder = options.keep or tempfile.mkdtemp()
    os.makedirs(options.folder, exist_ok=True)
    children = os.getpgrp()
    try:
        began = time.time()
        is_right = RUNS[options.run](options)
        print(f"{'right' if is_right else 'WRONG'} after {time.time() - began:.0f} s")
        return 0 if is_right else 1
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.killpg(children, signal.SIGTERM)
        if not options.keep:
            shutil.rmtree(options.folder, ignore_errors=True)


if __name__ == "__main__":
    os.setpgrp()
    sys.exit(main())
