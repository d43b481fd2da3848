#!/usr/bin/env python3
"""Measures from outside whether master keeps its deadlines, alone and beside another program.

Prints a Markdown table; the exit code is 1 if a deadline was missed. Only the standard
library is used.
"""

import argparse
import json
import os
import platform
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENES = {
    "cornell-box": ROOT / "scenes/cornell-box/cornell-box.toml",
    "nave": ROOT / "scenes/nave/nave.toml",
    "sibenik": ROOT / "scenes/sibenik.toml",
}
# More than any machine does in the longest deadline.
ENDLESS = "--vpls 16384 --vpl-sets 64"


def main():
    options = parse_options()
    rows = []
    for scene in options.scenes:
        if not is_there(scene):
            say(f"SKIPPED: {scene}: its model is not on this machine; set GRIDLIGHT_SCENES")
            continue
        for deadline in options.deadlines:
            rows += measure(options, scene, deadline)
    print_table(options, rows)
    sys.exit(1 if any(row["misses"] for row in rows) else 0)


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--master", type=Path, help="the program [default: cargo's debug build]")
    parser.add_argument("--runs", type=int, default=20, help="runs for each scene and deadline [default: 20]")
    parser.add_argument("--deadlines", type=float, nargs="+", default=[1, 2, 4, 8], metavar="SECONDS")
    parser.add_argument("--scenes", nargs="+", default=["cornell-box", "sibenik"], choices=sorted(SCENES))
    parser.add_argument("--flags", default=ENDLESS, help=f"for master [default: {ENDLESS}]")
    options = parser.parse_args()
    if options.master is None:
        target = os.environ.get("CARGO_TARGET_DIR", ROOT / "target")
        options.master = Path(target) / "debug/master"
    if not options.master.is_file():
        parser.error(f"{options.master} is not there; run `cargo build -p master`, or give --master")
    return options


def is_there(scene):
    if scene != "sibenik":
        return True
    folder = Path(os.environ.get("GRIDLIGHT_SCENES", ROOT / "../shared/scenes"))
    return (folder / "sibenik/sibenik.obj").is_file()


def measure(options, scene, deadline):
    """Runs alone and loaded in turn, so that neither has the better hour; two rows."""
    runs = {False: [], True: []}
    for number in range(options.runs):
        loaded = number % 2 == 1
        with Load(loaded):
            runs[loaded].append(run(options, scene, deadline))
        newest = runs[loaded][-1]
        how = "loaded" if loaded else "alone"
        say(f"{scene} {deadline:g} s {how}: {1e3 * newest['slack']:.0f} ms left, exit code {newest['code']}")
    return [summary(scene, deadline, loaded, results) for loaded, results in runs.items() if results]


class Load:
    """Another program that uses every core while a run lasts."""

    def __init__(self, wanted):
        self.count = os.cpu_count() if wanted else 0

    def __enter__(self):
        spin = [sys.executable, "-c", "while True: pass"]
        self.programs = [subprocess.Popen(spin) for _ in range(self.count)]

    def __exit__(self, *_):
        for program in self.programs:
            program.kill()
            program.wait()


def run(options, scene, deadline):
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "picture.exr"
        command = [options.master, "-q", "--json", "--scene", SCENES[scene], "--out", out]
        command += ["--deadline", str(deadline), *shlex.split(options.flags)]
        begun = time.monotonic()
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        wall = time.monotonic() - begun
        whole = out.is_file() and out.with_suffix(".png").is_file()
    if process.returncode != 0 or not whole:
        say(process.stderr)
    report = json.loads(process.stdout) if process.stdout else {}
    return {
        "code": process.returncode,
        "kept": process.returncode == 0 and whole and wall <= deadline,
        "slack": deadline - wall,
        "own_slack": report.get("slack_s", float("nan")),
    }


def summary(scene, deadline, loaded, results):
    slack = [result["slack"] for result in results]
    return {
        "scene": scene,
        "deadline": deadline,
        "loaded": loaded,
        "runs": len(results),
        "misses": sum(not result["kept"] for result in results),
        "median": statistics.median(slack),
        "least": min(slack),
        "own": statistics.median(result["own_slack"] for result in results),
    }


def print_table(options, rows):
    print(f"`master {options.flags}`, {os.cpu_count()} cores ({processor()}), {version(options.master)}\n")
    print("| Scene | Deadline | Cores | Runs | Missed | Median left | of D | Least left | Median by the report |")
    print("| --- | --: | --- | --: | --: | --: | --: | --: | --: |")
    for row in rows:
        cores = "in use by others" if row["loaded"] else "free"
        print(
            f"| {row['scene']} | {row['deadline']:g} s | {cores} | {row['runs']} | {row['misses']} "
            f"| {1e3 * row['median']:.0f} ms | {100 * row['median'] / row['deadline']:.1f} % "
            f"| {1e3 * row['least']:.0f} ms | {1e3 * row['own']:.0f} ms |"
        )


def processor():
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def version(master):
    return subprocess.run([master, "--version"], capture_output=True, text=True, check=True).stdout.strip()


def say(text):
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
