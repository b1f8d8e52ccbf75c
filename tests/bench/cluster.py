#!/usr/bin/env python3
"""Several servers that are one service, under faults and under load. Starts NATS, the servers and, where it is wanted, a
server of S3 on this machine, and ends with a failure if a job is lost, ends wrongly, or has other bytes than a server that
is alone draws.

    tests/bench/cluster.py kills        # a server is killed every 2 s for 60 s, NATS twice: 2,000 jobs on 4 servers
    tests/bench/cluster.py partition    # servers in namespaces of their own are cut off for 5 to 40 s (needs root)
    tests/bench/cluster.py slow-store   # a bucket whose connections take 2 s, and one of twenty of which breaks
    tests/bench/cluster.py duplicates   # 1,000 clients want 50 pictures
    tests/bench/cluster.py scaling      # 1, 2 and 4 servers, each with half a core; and what the queue costs per job.
                                        # With --share .2, four of them leave 2 cores something for NATS and the client
    tests/bench/cluster.py embedded --before OTHER/meshsnap
                                        # a server that is alone, with its data folder, beside one of another build: jobs and
                                        # pictures in turns, their times, CPU time and memory
    tests/bench/cluster.py homes        # 40 stored meshes in 6 looks each, in a random order, on 4 servers: how often a mesh
                                        # is read, and the CPU time of it all
    tests/bench/cluster.py zipf         # 3,000 requests for pictures of 40 stored meshes, some far more often than others
                                        # (Zipf), at 3 servers; then a server that starts cold is asked for all of them
    tests/bench/cluster.py model        # what servers and jobs cost NATS and the store, and what that means for 10, 100
                                        # and 1,000 servers

Options: --binary target/release/meshsnap, --jobs N, --seconds N, --nodes N, --nats nats-server, --keep FOLDER (logs stay there).
`slow-store` and `model` need moto, which tests/run installs: run them by target/python/bin/python.
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
import urllib.request

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
        self.monitor = free_port()
        arguments = [self.program, "-a", self.host, "-p", str(self.port), "-m", str(self.monitor), "-js",
                     "-sd", os.path.join(self.folder, "nats")]
        log = open(os.path.join(self.folder, "nats.log"), "ab")
        self.process = subprocess.Popen(arguments, stdout=log, stderr=log)
        wait_for_port(self.host, self.port)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def address(self):
        return f"nats://{self.host}:{self.port}/farm"

    def spent(self):
        """Messages in and out, their bytes, and seconds of CPU time."""
        with urllib.request.urlopen(f"http://{self.host}:{self.monitor}/varz") as answer:
            known = json.load(answer)
        messages = known["in_msgs"] + known["out_msgs"]
        return messages, known["in_bytes"] + known["out_bytes"], cpu_s(self.process.pid)


def cpu_s(pid):
    """CPU time of a process."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


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
        command = self.prefix + [self.options.binary, "serve", "--listen", self.listen, "--backend", "cpu"]
        if "--data-dir" not in self.arguments:
            command.append("--ephemeral")
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
    results = None
    if options.store is None:
        # What a killed server had begun to write has a # in its name.
        results = sum("#" not in name for name in os.listdir(os.path.join(options.folder, "store", "results")))
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


def many(servers, jobs, path=None, clients=16):
    """Sends jobs as fast as they are accepted. Their addresses by number."""
    with concurrent.futures.ThreadPoolExecutor(clients) as pool:
        return dict(enumerate(pool.map(lambda number: submit(servers, number, path=path), range(jobs))))


def duplicates(options):
    """1,000 clients want 50 pictures of a stored mesh."""
    _, servers = service(options, options.nodes)
    digest = hashlib.sha256(CUBE).hexdigest()
    assert servers[0].ask("POST", "/v1/meshes", CUBE)[0] == 201

    def send(number):
        size = 64 + number % 50
        document = json.dumps({"mesh": digest, "style": "wire", "image": {"width": size, "height": size, "format": "png"}})
        answer = random.choice(servers).ask("POST", "/v1/jobs", document, {"Content-Type": "application/json"})
        return answer[1]["location"] if answer[0] == 202 else sys.exit(f"refused: {answer}")

    count = min(options.jobs, 1000)
    with concurrent.futures.ThreadPoolExecutor(100) as pool:
        jobs = list(pool.map(send, range(count)))
    until = time.time() + 120
    with concurrent.futures.ThreadPoolExecutor(16) as pool:
        states = list(pool.map(lambda job: end_of(servers, job, until), jobs))
    done = sum(bool(state) and state["state"] == "done" for state in states)
    drawn = sum(server.metric("meshsnap_stage_seconds_count", 'stage="render"') for server in servers)
    print(f"{count} jobs of 50 kinds: {done} done, {drawn:.0f} drawn (at most 55)")
    return done == count and drawn <= 55


def bucket():
    """Host and port of a server of S3 with the bucket `farm`."""
    from moto.server import ThreadedMotoServer
    import boto3

    moto = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    moto.start()
    host, port = moto.get_host_and_port()
    boto3.client("s3", endpoint_url=f"http://{host}:{port}", region_name="us-east-1", aws_access_key_id="key",
                 aws_secret_access_key="secret").create_bucket(Bucket="farm")
    return host, port


def introduction(port):
    """The variables by which a server finds the bucket."""
    return {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", "AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret",
            "AWS_REGION": "us-east-1"}


def slow_store(options):
    """A bucket behind a proxy that waits 2 s on each connection and breaks one in twenty."""
    host, port = bucket()
    trouble = {"on": False}

    def pass_on(client):
        with client:
            if trouble["on"] and random.random() < 0.05:
                return
            if trouble["on"]:
                time.sleep(2)
            with socket.create_connection((host, port)) as server:
                def copy(source, target):
                    try:
                        while chunk := source.recv(1 << 16):
                            target.sendall(chunk)
                        target.shutdown(socket.SHUT_WR)
                    except OSError:
                        pass
                back = threading.Thread(target=copy, args=(server, client), daemon=True)
                back.start()
                copy(client, server)
                back.join()

    listener = socket.create_server(("127.0.0.1", 0))

    def accept():
        while True:
            client, _ = listener.accept()
            threading.Thread(target=pass_on, args=(client,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    options.store = "s3://farm/jobs"
    _, servers = service(options, 2, ["--workers", "2"], introduction(listener.getsockname()[1]))
    count, rates, jobs = min(options.jobs, 200), [], {}  # a multiple of the kinds of requests
    for is_slow in (False, True, False):
        trouble["on"] = is_slow
        began = time.time()
        part = {len(jobs) + number: job for number, job in many(servers, count).items()}
        ends = [end_of(servers, job, time.time() + 300) for job in part.values()]
        rates.append(count / (time.time() - began))
        print(f"{'slow' if is_slow else 'as it is'}: {rates[-1]:.1f} jobs a second, "
              f"{sum(bool(end) and end['state'] == 'done' for end in ends)} of {count} done")
        jobs.update(part)
    return check(options, servers, jobs, 60) and rates[2] > rates[0] / 2


def scaling(options):
    """Servers with half a core each; and what the queue costs each job."""
    path = "style=wire&size=700&samples=16"
    rates = {}
    for count in (1, 2, 4):
        options.folder = os.path.join(options.root, f"scale-{count}")
        os.makedirs(options.folder)
        nats, servers = service(options, count, ["--workers", "1", "--worker-threads", "1"])
        for server in servers:
            limit(server.process.pid, options.share)
        jobs = many(servers, 40 * count, path)
        began, until = time.time(), time.time() + 300
        if any(not (end := end_of(servers, job, until)) or end["state"] != "done" for job in jobs.values()):
            return False
        ends = [json.loads(servers[0].ask("GET", job)[2]) for job in list(jobs.values())[:4]]
        rates[count] = 40 * count / (time.time() - began)
        print(f"{count} servers: {rates[count]:.2f} pictures a second, efficiency {rates[count] / rates[1] / count:.2f}",
              f"(a picture takes {ends[-1]['result']['timings_ms']['render']:.0f} ms)")
        for server in servers:
            server.kill()
        nats.kill()
    options.folder = os.path.join(options.root, "overhead")
    os.makedirs(options.folder)
    nats, servers = service(options, 1)
    data = os.path.join(options.folder, "data")
    alone = Server(options, ["--data-dir", data])
    times = {"shared queue": [], "data folder": []}
    for number in range(200):
        for name, server in (("shared queue", servers[0]), ("data folder", alone)):
            began = time.time()
            job = submit([server], number, path="style=flat&size=32")
            end_of([server], job, time.time() + 60)
            times[name].append((time.time() - began) * 1e3)
    for name, values in times.items():
        cuts = statistics.quantiles(values, n=100)
        print(f"{name}: from POST to the end p50 {cuts[49]:.1f} ms, p99 {cuts[98]:.1f} ms")
    return rates[4] / rates[1] / 4 >= 0.85


def memory_mb(pid):
    """Memory of a process of its own, and of its files that are mapped."""
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        fields = dict(line.split(":", 1) for line in file)
    return [int(fields[name].split()[0]) / 1024 for name in ("RssAnon", "RssFile")]


def embedded(options):
    """Servers of two builds that are alone, in turns. Five pairs: memory differs a little from start to start."""
    if not options.before:
        sys.exit("--before names the other build's program")
    binaries, values = {"before": os.path.abspath(options.before), "now": options.binary}, {"before": {}, "now": {}}

    def note(build, name, value):
        values[build].setdefault(name, []).append(value)

    for pair in range(5):
        servers = {}
        for build in sorted(binaries, reverse=pair % 2 == 1):
            options.binary = binaries[build]
            servers[build] = Server(options, ["--data-dir", os.path.join(options.folder, f"data-{build}-{pair}")])
        time.sleep(2)
        for build, server in servers.items():
            for name, value in zip(("idle: own MB", "idle: mapped MB"), memory_mb(server.process.pid)):
                note(build, name, value)
        for number in range(300):
            for build in sorted(servers, reverse=number % 2 == 1):
                server, began = servers[build], time.time()
                end_of([server], submit([server], number, path="style=flat&size=32"), time.time() + 60)
                note(build, "job ms", (time.time() - began) * 1e3)
                began = time.time()
                assert server.ask("POST", f"/v1/render?{query(number)}", CUBE)[0] == 200
                note(build, "picture ms", (time.time() - began) * 1e3)
        for build, server in servers.items():
            note(build, "CPU s", cpu_s(server.process.pid))
            for name, value in zip(("after work: own MB", "after work: mapped MB"), memory_mb(server.process.pid)):
                note(build, name, value)
            server.kill()
    ratios = {}
    for name in values["now"]:
        before, now = (statistics.median(values[build][name]) for build in ("before", "now"))
        ratios[name] = now / before
        print(f"{name}: {before:.2f} before, {now:.2f} now, ratio {ratios[name]:.3f}")
    print("program: " + ", ".join(f"{os.path.getsize(binary) / 1e6:.1f} MB {build}" for build, binary in binaries.items()))
    # Repeated runs with the same program on both sides differ by up to 5 %.
    return all(ratio <= 1.05 for name, ratio in ratios.items() if "mapped" not in name)


def sheet(number, side=120):
    """A sheet with bumps, of 28,000 triangles."""
    lines = [f"v {i} {j} {(i * number + j * 7) % 41 * .05}" for i in range(side) for j in range(side)]
    for i in range(side - 1):
        for j in range(side - 1):
            first = i * side + j + 1
            lines.append(f"f {first} {first + 1} {first + side + 1} {first + side}")
    return "\n".join(lines).encode()


def homes(options):
    """Many looks of many meshes: a mesh should be read by few servers."""
    _, servers = service(options, options.nodes, ["--workers", "2", "--worker-threads", "1"])
    time.sleep(12)  # They hear of each other.
    digests = []
    for number in range(40):
        mesh = sheet(number)
        digests.append(hashlib.sha256(mesh).hexdigest())
        assert servers[number % len(servers)].ask("POST", "/v1/meshes?format_in=obj", mesh)[0] == 201
    wanted = [(digest, 128 + 16 * look) for digest in digests for look in range(6)]
    random.Random(7).shuffle(wanted)

    def send(want):
        document = json.dumps({"mesh": want[0], "style": "wire", "image": {"width": want[1], "height": want[1]}})
        answer = random.choice(servers).ask("POST", "/v1/jobs", document, {"Content-Type": "application/json"})
        return answer[1]["location"] if answer[0] == 202 else sys.exit(f"refused: {answer}")

    cpu, began = sum(cpu_s(server.process.pid) for server in servers), time.time()
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        jobs = list(pool.map(send, wanted))
        states = list(pool.map(lambda job: end_of(servers, job, began + 300), jobs))
    took, cpu = time.time() - began, sum(cpu_s(server.process.pid) for server in servers) - cpu
    done = sum(bool(state) and state["state"] == "done" for state in states)
    read = sum(server.metric("meshsnap_kept_entries", 'account="residents"') for server in servers)
    print(f"{done} of {len(jobs)} pictures of {len(digests)} meshes in {took:.1f} s, {cpu:.1f} s of CPU time; meshes were read {read:.0f} times")
    return done == len(jobs)


def zipf(options):
    """Where the pictures of stored meshes come from: this server's memory, the store, or a worker."""
    _, servers = service(options, 3)
    digests = []
    for number in range(40):
        mesh = sheet(number, 60)
        digests.append(hashlib.sha256(mesh).hexdigest())
        assert servers[0].ask("POST", "/v1/meshes?format_in=obj", mesh)[0] == 201
    wanted = [(digest, size) for digest in digests for size in (128, 192, 256, 320)]
    random.Random(3).shuffle(wanted)
    asked = random.Random(5).choices(wanted, [1 / rank for rank in range(1, len(wanted) + 1)], k=3000)

    def look(want, among):
        answer = random.choice(among).ask("GET", f"/v1/meshes/{want[0]}/render.png?style=wire&size={want[1]}")
        return answer[1].get("x-cache", "?") if answer and answer[0] == 200 else f"{answer and answer[0]}"

    def count(wants, among):
        with concurrent.futures.ThreadPoolExecutor(16) as pool:
            outcomes = list(pool.map(lambda want: look(want, among), wants))
        return {name: f"{100 * outcomes.count(name) / len(outcomes):.1f} %" for name in sorted(set(outcomes))}

    print(f"3 servers, {len(asked)} requests for {len(set(asked))} pictures: {count(asked, servers)}")
    cold = Server(options, servers[0].arguments)
    outcomes = count(sorted(set(asked)), [cold])
    print(f"a cold server, all of these once: {outcomes}")
    return "miss" not in outcomes


# Writes and reads a second of one prefix of a bucket on Amazon S3, by its documentation ("Best practices design patterns:
# optimizing Amazon S3 performance").
S3_WRITES, S3_READS = 3500, 5500

# Jobs a second of one server in the model: 8 cores, and 40 ms of one of them for a picture.
SERVER_JOBS = 200


def model(options):
    """What a server that has nothing to do costs, what a job costs, and what gives out first with more of them."""
    from werkzeug.serving import WSGIRequestHandler

    asked, idle_s, jobs = {}, 20, min(options.jobs, 400)

    def count(handler, *_):
        asked[handler.command] = asked.get(handler.command, 0) + 1

    def spent_in(nats, work):
        before, stored = nats.spent(), dict(asked)
        work()
        after = nats.spent()
        operations = {name: number - stored.get(name, 0) for name, number in asked.items() if number > stored.get(name, 0)}
        return [b - a for a, b in zip(before, after)], operations

    WSGIRequestHandler.log_request = count
    _, port = bucket()
    options.store = "s3://farm/jobs"
    nats, servers = service(options, options.nodes, ["--quota-per-day", "1000000"], introduction(port))
    time.sleep(15)
    (idle, idle_bytes, idle_cpu), operations = spent_in(nats, lambda: time.sleep(idle_s))
    per_server = [value / idle_s / options.nodes for value in (idle, idle_bytes, idle_cpu)]
    print(f"idle, each of {options.nodes} servers: {per_server[0]:.1f} messages and {per_server[1] / 1e3:.2f} kB a second, "
          f"{per_server[2] * 1e3:.2f} ms of NATS's CPU; the store is asked {sum(operations.values()) / idle_s / options.nodes:.2f} times: "
          f"{operations}")

    def work():
        sent = many(servers, jobs, "style=flat&size=32")
        ends = [end_of(servers, job, time.time() + 120) for job in sent.values()]
        assert all(end and end["state"] == "done" for end in ends)

    began = time.time()
    (messages, size, cpu), operations = spent_in(nats, work)
    taken = (time.time() - began) * options.nodes
    messages, size, cpu = (max(0, value - own * taken) / jobs for value, own in zip((messages, size, cpu), per_server))
    writes = sum(operations.get(name, 0) for name in ("PUT", "POST", "DELETE")) / jobs
    reads = sum(operations.get(name, 0) for name in ("GET", "HEAD")) / jobs
    print(f"a job: {messages:.1f} messages and {size / 1e3:.2f} kB of NATS, {cpu * 1e3:.2f} ms of its CPU; "
          f"{writes:.2f} writes and {reads:.2f} reads of the store: {operations}")

    print(f"with {SERVER_JOBS} jobs a second of each server:")
    print("servers  jobs/s   NATS: messages/s    MB/s  cores  news/s   store: writes/s  reads/s  prefixes needed")
    for number in (10, 100, 1000):
        rate = number * SERVER_JOBS
        values = [number * own + rate * each for own, each in zip(per_server, (messages, size, cpu))]
        prefixes = max(rate * writes / S3_WRITES, rate * reads / S3_READS)
        # Every server hears every other one: that it is there, and what it has admitted, as `shared_jobs/news.rs` says.
        news = number * number * (.1 / max(1, number // 100) + 5 / max(1, number // 20))
        print(f"{number:7} {rate:7} {values[0]:18.0f} {values[1] / 1e6:7.1f} {values[2]:6.1f} {news:7.0f} {rate * writes:17.0f} {rate * reads:8.0f} {prefixes:16.1f}")
    return True


def limit(pid, cores):
    """Holds a process at part of a core by a group of its own (cgroup 2, or 1)."""
    for root, name, value in (("/sys/fs/cgroup", "cpu.max", f"{int(cores * 1e5)} 100000"),
                              ("/sys/fs/cgroup/cpu", "cpu.cfs_quota_us", str(int(cores * 1e5)))):
        if not os.path.exists(os.path.join(root, "cgroup.procs")):
            continue
        group = os.path.join(root, f"meshsnap-bench-{pid}")
        try:
            os.makedirs(group, exist_ok=True)
            with open(os.path.join(group, name), "w", encoding="ascii") as file:
                file.write(value)
            with open(os.path.join(group, "cgroup.procs"), "w", encoding="ascii") as file:
                file.write(str(pid))
            return
        except OSError as error:
            print(error)
    sys.exit("no control group can be made here: run it as root")


def partition(options):
    """Servers in network namespaces whose links are cut at random for 5 to 40 s."""
    def ip(*arguments):
        subprocess.run(["ip", *arguments], check=True)

    names = [f"ms{os.getpid() % 10000}n{number}" for number in range(options.nodes)]
    ip("link", "add", "msbridge", "type", "bridge")
    ip("addr", "add", "10.77.0.1/24", "dev", "msbridge")
    ip("link", "set", "msbridge", "up")
    try:
        nats = Nats(options.nats, options.folder, "10.77.0.1")
        store = os.path.join(options.folder, "store")
        os.makedirs(store)
        servers = []
        for number, name in enumerate(names):
            ip("netns", "add", name)
            ip("link", "add", f"{name}a", "type", "veth", "peer", "name", f"{name}b", "netns", name)
            ip("link", "set", f"{name}a", "master", "msbridge", "up")
            address = f"10.77.0.{number + 10}"
            ip("-n", name, "addr", "add", f"{address}/24", "dev", f"{name}b")
            ip("-n", name, "link", "set", f"{name}b", "up")
            ip("-n", name, "link", "set", "lo", "up")
            arguments = ["--queue", nats.address(), "--store", f"file://{store}", "--workers", "2", "--no-auth"]
            servers.append(Server(options, arguments, prefix=["ip", "netns", "exec", name], listen=f"{address}:8080"))
        over, cuts = threading.Event(), []

        def disturb(number):
            while not over.wait(random.uniform(2, 10)):
                time_s = random.uniform(5, 40)
                cuts.append(time_s)
                ip("link", "set", f"{names[number]}a", "down")
                over.wait(time_s)
                ip("link", "set", f"{names[number]}a", "up")

        disturbing = [threading.Thread(target=disturb, args=(number,)) for number in range(options.nodes)]
        for thread in disturbing:
            thread.start()
        jobs, began = {}, time.time()

        def send(first):
            for number in range(first, options.jobs, 8):
                if time.time() - began > options.seconds:
                    return
                jobs[number] = submit_with_patience(servers, number)
                time.sleep(options.seconds * 8 / options.jobs * random.random())

        with concurrent.futures.ThreadPoolExecutor(8) as pool:
            list(pool.map(send, range(8)))
        over.set()
        for thread in disturbing:
            thread.join()
        print(f"{len(cuts)} cuts of {min(cuts):.0f} to {max(cuts):.0f} s")
        return check(options, servers, dict(sorted(jobs.items())), 180)
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False)
        subprocess.run(["ip", "link", "del", "msbridge"], check=False)


def submit_with_patience(servers, number):
    """A server that is cut off does not answer: the next one is asked under the same name."""
    key = f"job-{number}-{os.getpid()}"
    while True:
        answer = random.choice(servers).ask("POST", f"/v1/jobs?{query(number)}", CUBE, {"Idempotency-Key": key}, timeout=3)
        if answer and answer[0] == 202:
            return answer[1]["location"]


RUNS = {"kills": kills, "partition": partition, "slow-store": slow_store, "duplicates": duplicates, "scaling": scaling,
        "embedded": embedded, "homes": homes, "zipf": zipf, "model": model}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("run", choices=RUNS)
    parser.add_argument("--binary", default="target/release/meshsnap")
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--nodes", type=int, default=4)
    parser.add_argument("--nats", default=shutil.which("nats-server") or "/usr/sbin/nats-server")
    parser.add_argument("--share", type=float, default=0.5, help="of a core, for each server of `scaling`")
    parser.add_argument("--before", help="the program of another build, for `embedded`")
    parser.add_argument("--keep")
    options = parser.parse_args()
    options.binary, options.store = os.path.abspath(options.binary), None
    options.folder = options.root = options.keep or tempfile.mkdtemp()
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
            shutil.rmtree(options.root, ignore_errors=True)


if __name__ == "__main__":
    os.setpgrp()
    sys.exit(main())
