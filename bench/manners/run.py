#!/usr/bin/env python3
"""What the owner of a machine notices of a hungry worker; prints a Markdown table.

A master without slots of its own renders a workload without end, and a worker renders for it, in a session of its
own like a service. Beside them runs the owner's program, a fixed amount of arithmetic: once while the worker
works, once while it is stopped, in turn and in random order, so that whatever else happens on the machine falls
on both alike. Then a second worker has to follow the load.
"""

import argparse
import json
import os
import random
import socket
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Where the worker looks for its owner while it renders; see worker/src/manners/mod.rs.
GLANCE_MS = 20


def main():
    options = parse_options()
    print("| What | Measured | Wanted |\n| --- | --: | --: |")
    with tempfile.TemporaryDirectory() as folder, Grid(options, Path(folder), options.slots) as grid:
        owner_pays(grid, options)
        owner_waits(grid, options)
    with tempfile.TemporaryDirectory() as folder, Grid(options, Path(folder), "auto") as grid:
        slots_follow(grid, options)


def owner_pays(grid, options):
    """By how much longer the owner's programs take."""
    grid.work()
    for programs in sorted({1, os.cpu_count()}):
        slowdowns = [pair(grid, programs, options.seconds) for _ in range(options.pairs)]
        wall, processor = (100 * statistics.median(column) for column in zip(*slowdowns))
        name = f"{programs} program{'s' if programs > 1 else ''} of the owner"
        print(f"| {name}: longer by the clock, median of {len(slowdowns)} pairs | {wall:+.1f} % | < 3 % |")
        print(f"| the same: more processor time | {processor:+.1f} % | < 3 % |", flush=True)


def owner_waits(grid, options):
    """How soon the owner has the processor for himself."""
    stops = [grid.stop_ms() for _ in range(options.stops)]
    for (clock, processor), name in ((map(statistics.median, zip(*stops)), f"median of {len(stops)}"),
                                     (map(p99, zip(*stops)), "99th percentile")):
        print(f"| order to pause to last slot stopped, {name} | {clock:.0f} ms | |")
        print(f"| processor time of a slot meanwhile, {name} | {processor:.0f} ms | |")
    print(f"| with {GLANCE_MS} ms to see the owner's hand | {clock + GLANCE_MS:.0f} ms | < 100 ms |", flush=True)


def p99(values):
    return sorted(values)[min(len(values) - 1, int(0.99 * len(values)))]


def slots_follow(grid, options):
    """How soon `--slots auto` makes room for a program, and takes it back when that ends."""
    reactions = [times for _ in range(options.loads) if (times := grid.reaction_s())]
    if not reactions:
        print("| `--slots auto`: not measured, other programs use this machine | | |")
        return
    for what, times in zip(("a program comes: fewer slots", "it ends: all slots again"), zip(*reactions)):
        print(f"| `--slots auto`, {what}, median of {len(times)} | {statistics.median(times):.2f} s | |")
        print(f"| the same, longest | {max(times):.2f} s | < 1 s |", flush=True)


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=Path, help="folder of master and worker [default: cargo's debug builds]")
    parser.add_argument("--scene", type=Path, default=ROOT / "scenes/nave/nave.toml", help="[default: the nave]")
    cores = str(os.cpu_count())
    parser.add_argument("--slots", default=cores, help="auto, or so many whatever the owner does [default: one a core]")
    parser.add_argument("--pairs", type=int, default=15, help="[default: 15]")
    parser.add_argument("--seconds", type=float, default=2.0, help="of the owner's program [default: 2]")
    parser.add_argument("--stops", type=int, default=100, help="[default: 100]")
    parser.add_argument("--loads", type=int, default=20, help="for --slots auto [default: 20]")
    options = parser.parse_args()
    if options.programs is None:
        options.programs = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug"
    for name in ("master", "worker"):
        if not (options.programs / name).is_file():
            parser.error(f"there is no {name} in {options.programs}; run `cargo build -p master -p worker`")
    return options


class Grid:
    """A master, and a worker that never has enough to do."""

    def __init__(self, options, folder, slots):
        self.socket = folder / "control.sock"
        port = free_port()
        job = ["--no-deadline", "--spp", "65536", "--vpls", "65536", "--vpl-sets", "4096", "--local-slots", "0"]
        master = [options.programs / "master", "-q", "--scene", options.scene, "--out", folder / "picture.exr"]
        self.master = subprocess.Popen([*master, *job, "--listen", f"127.0.0.1:{port}"])
        worker = [options.programs / "worker", "-q", "--connect", f"127.0.0.1:{port}", "--slots", slots]
        # What others left on this machine's disk must not matter.
        places = {"RUNTIME_DIRECTORY": str(folder), "CACHE_DIRECTORY": str(folder)}
        self.worker = subprocess.Popen(worker, env={**os.environ, **places}, start_new_session=True)

    def __enter__(self):
        wait_until(self.socket.exists, "the worker listens")
        return self

    def __exit__(self, *_):
        for process in (self.worker, self.master):
            process.kill()
            process.wait()

    def order(self, name):
        """Gives an order and returns the status that follows from it."""
        order = {"pause": {"seconds": 3600}} if name == "pause" else name
        with socket.socket(socket.AF_UNIX) as stream:
            stream.connect(str(self.socket))
            stream.sendall(json.dumps(order).encode() + b"\n")
            return json.loads(stream.makefile().readline())["status"]

    def slots_ran_ms(self):
        """Processor time that each slot has used so far."""
        times = []
        for task in sorted(Path(f"/proc/{self.worker.pid}/task").iterdir()):
            if (task / "comm").read_text().startswith("slot"):
                times.append(int((task / "schedstat").read_text().split()[0]) * 1e-6)
        return times

    def work(self):
        """Lets the worker render, and waits until it does."""
        self.order("resume")
        results = self.order("status")["results"]
        wait_until(lambda: self.order("status")["results"] > results, "the worker renders again")

    def stop_ms(self):
        """From an order to pause, given at any moment, until no slot runs any more; and how long one ran at most."""
        self.work()
        time.sleep(random.uniform(0.0, 0.1))
        begun, first = time.monotonic(), self.slots_ran_ms()
        self.order("pause")
        ran, ran_until = first, begun
        while time.monotonic() < begun + 0.3:
            time.sleep(0.002)
            now, before = time.monotonic(), ran
            ran = self.slots_ran_ms()
            if ran != before:
                ran_until = now
        return 1000 * (ran_until - begun), max(after - at_first for after, at_first in zip(ran, first))

    def reaction_s(self):
        """From a program's start to fewer slots, and from its end to all slots; None if others are in the way."""
        try:
            self.wait_for_slots(lambda slots, most: slots == most, patience_s=10)
        except TimeoutError:
            return None
        # At any moment between two looks.
        time.sleep(random.uniform(1.0, 1.3))
        program = subprocess.Popen(["awk", "BEGIN { for (;;) x += 1 }"])
        try:
            down = self.wait_for_slots(lambda slots, most: slots < most)
            time.sleep(random.uniform(1.0, 1.3))
        finally:
            program.kill()
            program.wait()
        return down, self.wait_for_slots(lambda slots, most: slots == most)

    def wait_for_slots(self, are_so, patience_s=60):
        """The time until the number of slots is so."""
        begun = time.monotonic()
        while (now := time.monotonic()) < begun + patience_s:
            status = self.order("status")
            if are_so(status["slots"], status["slots_max"]):
                return now - begun
            time.sleep(0.005)
        raise TimeoutError("waited in vain for the slots to follow the load")


def pair(grid, programs, seconds):
    """By which parts the owner's programs take longer beside the worker: by the clock, of processor time."""
    with_worker, without = None, None
    for at_work in random.sample([True, False], 2):
        if at_work:
            grid.order("resume")
        else:
            grid.order("pause")
        # Slots come and go within a second.
        time.sleep(1.2)
        if at_work:
            with_worker = owner(programs, seconds)
        else:
            without = owner(programs, seconds)
    grid.order("resume")
    return [a / b - 1 for a, b in zip(with_worker, without)]


def owner(programs, seconds):
    """Runs programs side by side; the clock's time and their processor time."""
    # awk does some thirty million of these a second.
    command = ["awk", f"BEGIN {{ for (i = 0; i < {int(seconds * 3e7)}; i++) x += i * i }}"]
    begun, used = time.monotonic(), children_s()
    running = [subprocess.Popen(command) for _ in range(programs)]
    for process in running:
        process.wait()
    return time.monotonic() - begun, children_s() - used


def children_s():
    times = os.times()
    return times.children_user + times.children_system


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def wait_until(is_so, what):
    patience = time.monotonic() + 60
    while not is_so():
        if time.monotonic() > patience:
            raise SystemExit(f"waited in vain: {what}")
        time.sleep(0.01)


if __name__ == "__main__":
    main()
