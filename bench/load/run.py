#!/usr/bin/env python3
"""Measures how many workers and tasks a master can carry. Prints a Markdown table.

The workers are one process that pretends (load.rs); the master is the real one, and traces nothing itself.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main():
    options = parse_options()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    print(f"{options.workers} workers × {options.slots} slots, {options.groups} groups of 1024×768, "
          f"deadline {options.deadline:g} s\n")
    print("| Task takes | Joined | Results | Results/s | First tasks | Wait, median | p99 | longest | Master's memory "
          "| its processor | Left |")
    print("| --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: |")
    for task_ms in options.task_ms:
        print(row(options, task_ms), flush=True)


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=1000, help="[default: 1000]")
    parser.add_argument("--slots", type=int, default=4, help="[default: 4]")
    parser.add_argument("--task-ms", type=int, nargs="+", default=[800], help="[default: 800]")
    parser.add_argument("--groups", type=int, default=2048, help="[default: 2048]")
    parser.add_argument("--deadline", type=float, default=12, help="seconds [default: 12]")
    options = parser.parse_args()
    options.target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug"
    for program in ["master", "examples/load"]:
        if not (options.target / program).is_file():
            parser.error(f"{program} is not there; see bench/load/README.md")
    return options


def row(options, task_ms):
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [options.target / "master", "--deadline", str(options.deadline), "--local-slots", "0"]
        command += ["--listen", "127.0.0.1:0", "--size", "1024x768", "--groups", str(options.groups)]
        command += ["--spp", "32", "--vpls", "512", "--vpl-sets", "32", "--pixels", "shared-exponent"]
        command += ["--out", Path(folder) / "picture.exr", "--report", report, "-v"]
        master = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        for line in master.stderr:
            if found := re.search(r"workers may connect.*address=(\S+)", re.sub(r"\x1b\[[0-9;]*m", "", line)):
                break
        # What it says must not fill the pipe.
        threading.Thread(target=master.stderr.read, daemon=True).start()
        load = [options.target / "examples/load", "--connect", found[1], "--workers", str(options.workers)]
        load += ["--slots", str(options.slots), "--task-ms", str(task_ms), "--within", str(int(options.deadline) + 5)]
        load = subprocess.Popen(load, stdout=subprocess.PIPE, text=True)
        memory, processor = watch(master)
        seen = json.loads(load.communicate()[0])
        delivered = json.loads(report.read_text(encoding="utf-8"))
    wait = seen["wait_ms"]
    cells = [f"{task_ms} ms", seen["joined"], seen["results"], f"{seen['results'] / seen['seconds']:.0f}"]
    cells += [f"{seen['begin_ms']:.0f} ms"]
    cells += [f"{wait[name]:.1f} ms" for name in ("p50", "p99", "max")]
    cells += [f"{memory / 1e6:.0f} MB", f"{processor:.1f} s", f"{1e3 * delivered['slack_s']:.0f} ms"]
    return "| " + " | ".join(map(str, cells)) + " |"


def watch(process):
    """Largest resident memory of a process in bytes, and its processor time in seconds, until it ends."""
    memory, processor = 0, 0.0
    while process.poll() is None:
        try:
            status = Path(f"/proc/{process.pid}/status").read_text()
            fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            break
        if found := re.search(r"VmHWM:\s+(\d+) kB", status):
            memory = max(memory, 1024 * int(found[1]))
            processor = sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
        time.sleep(0.05)
    process.wait()
    return memory, processor


if __name__ == "__main__":
    main()
