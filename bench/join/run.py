#!/usr/bin/env python3
"""How soon a worker is at work: with the scene in memory, on disk, nowhere, and after its cable was pulled.

Real processes with a key, on loopback and, for the cable, in network namespaces. Prints a Markdown table, or
with --json the same as one object. The exit code is 1 if anything took longer than is wanted.
"""

import argparse
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# A worker that has heard nothing of its master for 1.5 s (MASTER_SILENCE) gives it up.
OUTAGE_S = 2.0


def main():
    options = parse_options()
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        key = folder / "grid.key"
        subprocess.run([options.programs / "master", "keygen", "--out", key], check=True, capture_output=True)
        rows = on_loopback(options, folder, key)
        rows += by_cable(options, folder, key)
    if options.json:
        print(json.dumps({"scene": options.scene.stem, "rows": rows}, indent=2))
    else:
        print(f"{options.scene.stem}, 1024×768, one slot:\n\n| What | Measured | Wanted |\n| --- | --: | --: |")
        for row in rows:
            print(f"| {row['what']} | {row['measured']:.0f} {row['unit']} | {wanted(row)} |")
    sys.exit(any(row["wanted"] is not None and row["measured"] > row["wanted"] for row in rows))


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=Path, help="folder of master and worker [default: cargo's debug builds]")
    parser.add_argument("--scene", type=Path, help="[default: sibenik, the nave where its model is missing]")
    parser.add_argument("--joins", type=int, default=20, help="with the scene in memory [default: 20]")
    parser.add_argument("--starts", type=int, default=5, help="without it, and as many with it on disk [default: 5]")
    parser.add_argument("--outages", type=int, default=5, help="[default: 5]")
    parser.add_argument("--json", action="store_true", help="as one object")
    options = parser.parse_args()
    if options.programs is None:
        options.programs = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug"
    for name in ("master", "worker"):
        if not (options.programs / name).is_file():
            parser.error(f"there is no {name} in {options.programs}; run `cargo build -p master -p worker`")
    if options.scene is None:
        models = Path(os.environ.get("GRIDLIGHT_SCENES", ROOT / "../shared/scenes"))
        has_model = (models / "sibenik/sibenik.obj").is_file()
        options.scene = ROOT / ("scenes/sibenik.toml" if has_model else "scenes/nave/nave.toml")
        if not has_model:
            say("sibenik's model is not on this machine, so it is the nave; set GRIDLIGHT_SCENES")
    return options


def on_loopback(options, folder, key):
    """Connections that break, and workers that start, beside a master that has work."""
    seconds = 30 + options.joins + 6 * options.starts
    with Master(options, folder, key, "127.0.0.1", seconds) as master:
        with Relay(master.address) as relay, Worker(options, folder / "warm", key, relay.address, "warm") as worker:
            worker.wait_for_result()
            cuts = []
            for _ in range(options.joins):
                # The worker's own rhythm must not be ours.
                time.sleep(0.1 + 0.4 * len(cuts) / options.joins)
                cuts.append(time.monotonic())
                relay.cut()
                worker.wait_for_result()
        starts = {}
        for number in range(options.starts):
            for kind in ("cold", "disk"):
                name = f"{kind} {number}"
                with Worker(options, folder / f"cache {number}", key, master.address, name) as worker:
                    worker.wait_for_result()
                starts[name] = (worker.started, worker.first_result)
        report = master.stop()
    visits = [visit for visit in report["workers"] if visit["name"] == "warm"][1:]
    check(len(visits) == options.joins, f"{options.joins} connections were cut, and {len(visits)} followed")
    rows = [
        row("scene in memory: from joining to the first task, median", joining_ms(visits), "ms", 150),
        row("the same, longest", joining_ms(visits), "ms", None, max),
        row("from a broken connection to the first task, median",
            [master.ms_after(cut, visit["first_task_s"]) for cut, visit in zip(cuts, visits)], "ms", 1000),
    ]
    names = {"cold": "scene nowhere", "disk": "worker started again, scene on its disk"}
    for kind, what in names.items():
        visits = [visit for visit in report["workers"] if visit["name"].startswith(kind)]
        check(len(visits) == options.starts, f"{len(visits)} of {options.starts} workers came")
        begun = [starts[visit["name"]][0] for visit in visits]
        first = [master.ms_after(start, visit["first_task_s"]) for start, visit in zip(begun, visits)]
        result = [1e3 * (starts[visit["name"]][1] - start) for start, visit in zip(begun, visits)]
        rows += [
            row(f"{what}: scene sent, BVH built and first task, since joining, median", joining_ms(visits), "ms",
                1500 if kind == "cold" else None),
            row("the same, since the start of the process", first, "ms", None),
            row("first result, since the start of the process", result, "ms", None),
            row("bytes of the scene, most", [visit["scene_bytes"] for visit in visits], "B",
                0 if kind == "disk" else None, max),
        ]
    return rows


def by_cable(options, folder, key):
    """A worker on another host, whose cable is pulled and put back."""
    try:
        network = Network()
    except (OSError, subprocess.CalledProcessError) as error:
        say(f"SKIPPED: hosts in network namespaces: {error}; they need root and `ip`")
        return []
    seconds = 20 + options.outages * (OUTAGE_S + 3)
    with network, Master(options, folder, key, network.MASTER, seconds, network.on("master")) as master, \
            Worker(options, folder / "cable", key, master.address, "cable", network.on("worker")) as worker:
        worker.wait_for_result()
        mended = []
        for number in range(options.outages):
            network.cut()
            time.sleep(OUTAGE_S + 0.5 * number / options.outages)
            mended.append(time.monotonic())
            network.mend()
            worker.wait_for_result()
            time.sleep(0.5)
        report = master.stop()
    visits = report["workers"][1:]
    check(len(visits) == options.outages, f"{options.outages} outages, and {len(visits)} connections after them")
    back = [master.ms_after(since, visit["first_task_s"]) for since, visit in zip(mended, visits)]
    return [
        row(f"cable pulled for {OUTAGE_S:g} s and put back: until the first task, median", back, "ms", 1000),
        row("the same, longest", back, "ms", None, max),
    ]


def row(what, values, unit, most, of=statistics.median):
    return {"what": what, "unit": unit, "measured": of(values), "wanted": most, "values": values}


def wanted(row):
    if row["wanted"] is None:
        return ""
    return f"{'≤' if row['wanted'] == 0 else '<'} {row['wanted']} {row['unit']}"


def joining_ms(visits):
    return [1e3 * (visit["first_task_s"] - visit["joined_s"]) for visit in visits]


class Master:
    """One that has work until it is stopped, and none of its own slots to do it."""

    def __init__(self, options, folder, key, host, seconds, prefix=()):
        self.port = free_port()
        self.address = f"{host}:{self.port}"
        self.report = folder / f"report {self.port}.json"
        command = [*prefix, options.programs / "master", "-q", "--deadline", str(seconds), "--size", "1024x768"]
        command += ["--scene", options.scene, "--out", folder / "picture.exr", "--report", self.report]
        command += ["--local-slots", "0", "--listen", self.address, "--key", key]
        # Its report counts from here.
        self.begun = time.monotonic()
        self.process = subprocess.Popen(command)

    def __enter__(self):
        return self

    def stop(self):
        """Ends the frame; the report."""
        check(self.process.poll() is None, "the deadline came before everything was measured")
        self.process.send_signal(signal.SIGINT)
        self.process.wait(60)
        return json.loads(self.report.read_text(encoding="utf-8"))

    def ms_after(self, moment, seconds):
        """From a moment of our clock to one of the report."""
        return 1e3 * (self.begun + seconds - moment)

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


class Worker:
    """A worker with a cache of its own."""

    def __init__(self, options, folder, key, address, name, prefix=()):
        folder.mkdir(exist_ok=True)
        self.socket = folder / "control.sock"
        self.first_result = None
        command = [*prefix, options.programs / "worker", "-q", "--connect", address, "--name", name]
        command += ["--slots", "1", "--key", key]
        places = {"RUNTIME_DIRECTORY": str(folder), "CACHE_DIRECTORY": str(folder / "cache")}
        self.started = time.monotonic()
        self.process = subprocess.Popen(command, env={**os.environ, **places})

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.socket.unlink(missing_ok=True)

    def results(self):
        with socket.socket(socket.AF_UNIX) as stream:
            stream.connect(str(self.socket))
            stream.sendall(b'"status"\n')
            return json.loads(stream.makefile().readline())["status"]["results"]

    def wait_for_result(self):
        """Until it has sent one more than now."""
        before, patience = None, time.monotonic() + 60
        while time.monotonic() < patience:
            try:
                results = self.results()
            except OSError:
                # It has just been started.
                results = 0
            if before is None:
                before = results
            if results > before:
                self.first_result = self.first_result or time.monotonic()
                return
            time.sleep(0.002)
        raise SystemExit("waited in vain for a result")


class Relay:
    """Passes bytes on between workers and a master, until the connection is cut."""

    def __init__(self, address):
        host, port = address.split(":")
        self.master = (host, int(port))
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self.listener.getsockname()[1]}"
        self.open = []
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                worker, _ = self.listener.accept()
                master = socket.create_connection(self.master)
            except OSError:
                # The relay is closed, or there is no master yet: the worker tries again.
                if self.listener.fileno() < 0:
                    return
                worker.close()
                continue
            self.open += [worker, master]
            for one, other in ((worker, master), (master, worker)):
                one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                threading.Thread(target=pass_on, args=(one, other), daemon=True).start()

    def cut(self):
        sockets, self.open = self.open, []
        for one in sockets:
            try:
                one.shutdown(socket.SHUT_RDWR)
            except OSError:
                # The other end was faster.
                pass
            one.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.close()
        self.cut()


def pass_on(one, other):
    try:
        while data := one.recv(1 << 16):
            other.sendall(data)
        other.shutdown(socket.SHUT_WR)
    except OSError:
        # It was cut.
        pass


class Network:
    """Two hosts with a network each, and a switch at which the worker's cable can be pulled."""

    MASTER, WORKER = "10.78.0.1", "10.78.0.2"

    def __init__(self):
        self.name = f"gridlight-join-{os.getpid()}"
        try:
            self.ip(f"netns add {self.name}-switch")
            self.at("switch", "link add bridge type bridge")
            self.at("switch", "link set bridge up")
            for host, address in (("master", self.MASTER), ("worker", self.WORKER)):
                self.ip(f"netns add {self.name}-{host}")
                self.at("switch", f"link add to-{host} type veth peer name eth0 netns {self.name}-{host}")
                self.at("switch", f"link set to-{host} master bridge up")
                self.at(host, f"addr add {address}/24 dev eth0")
                self.at(host, "link set eth0 up")
                self.at(host, "link set lo up")
        except BaseException:
            self.__exit__()
            raise

    def on(self, host):
        """How a command line begins that is carried out there."""
        return ["ip", "netns", "exec", f"{self.name}-{host}"]

    def cut(self):
        # Neither of the two notices.
        self.at("switch", "link set to-worker nomaster")

    def mend(self):
        self.at("switch", "link set to-worker master bridge")

    def at(self, host, arguments):
        self.ip(f"-n {self.name}-{host} {arguments}")

    @staticmethod
    def ip(arguments):
        subprocess.run(["ip", *arguments.split()], check=True, capture_output=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for host in ("master", "worker", "switch"):
            subprocess.run(["ip", "netns", "del", f"{self.name}-{host}"], check=False, capture_output=True)


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def check(is_so, otherwise):
    if not is_so:
        raise SystemExit(f"cannot measure: {otherwise}")


def say(text):
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
