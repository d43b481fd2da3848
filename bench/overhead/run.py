#!/usr/bin/env python3
"""Measures what a full frame costs besides tracing and shading. Prints a Markdown table."""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main():
    options = parse_options()
    runs = [run(options) for _ in range(options.runs)]
    print(f"`master --paper --no-deadline`, {options.scene.stem}, {runs[0]['slots']} slots; medians of {len(runs)}\n")
    print("| What | Measured | Wanted |")
    print("| --- | --: | --: |")

    def median(name):
        return statistics.median(run[name] for run in runs)

    print(f"| busy / (slots × tracing time) | {100 * median('busy'):.1f} % | ≥ 95 % |")
    print(f"| start to first task | {median('first_task_s'):.3f} s | < 0.3 s |")
    print(f"| worker's largest resident memory | {median('worker_bytes') / 1e9:.2f} GB | < 1.5 GB |")
    print(f"| tracing | {median('tracing_s'):.2f} s | |")
    print(f"| rays | {median('mrays_per_s'):.1f} million/s | |")


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--master", type=Path, help="the program [default: cargo's debug build]")
    parser.add_argument("--scene", type=Path, help="[default: sibenik, or else the nave]")
    parser.add_argument("--runs", type=int, default=3, help="[default: 3]")
    options = parser.parse_args()
    if options.master is None:
        options.master = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug/master"
    if not options.master.is_file():
        parser.error(f"{options.master} is not there; run `cargo build -p master`, or give --master")
    if options.scene is None:
        folder = Path(os.environ.get("GRIDLIGHT_SCENES", ROOT / "../shared/scenes"))
        is_there = (folder / "sibenik/sibenik.obj").is_file()
        options.scene = ROOT / ("scenes/sibenik.toml" if is_there else "scenes/nave/nave.toml")
    return options


def run(options):
    with tempfile.TemporaryDirectory() as folder:
        report_file = Path(folder) / "report.json"
        command = [options.master, "-q", "--paper", "--no-deadline", "--scene", options.scene]
        command += ["--out", Path(folder) / "picture.exr", "--report", report_file]
        process = subprocess.Popen(command)
        worker_bytes = watch(process)
        if process.returncode != 0:
            raise SystemExit(f"master ended with exit code {process.returncode}")
        report = json.loads(report_file.read_text(encoding="utf-8"))
    seconds = report["seconds"]
    after = ["tracing", "reconstruct", "encode", "write"]
    rays = report["shadow_rays"] + report["primary_rays"]
    return {
        "slots": report["slots"],
        "busy": report["busy_slot_seconds"] / (report["slots"] * seconds["tracing"]),
        # One phase follows the other without a pause.
        "first_task_s": report["elapsed_s"] - sum(seconds[phase] for phase in after),
        "worker_bytes": worker_bytes,
        "tracing_s": seconds["tracing"],
        "mrays_per_s": 1e-6 * rays / seconds["tracing"],
    }


def watch(process):
    """The largest resident memory of the processes that the master starts."""
    most = 0
    while process.poll() is None:
        most = max([most, *map(peak_bytes, children(process.pid))])
        time.sleep(0.01)
    return most


def children(pid):
    found = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += path.read_text(encoding="ascii").split()
        except OSError:
            # The thread has ended.
            continue
    return found


def peak_bytes(pid):
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    except OSError:
        return 0
    kibs = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return 1024 * int(kibs[0]) if kibs else 0


if __name__ == "__main__":
    main()
