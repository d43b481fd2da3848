"""What all peers have in common: their command line, the clock, and the exported scene."""

import argparse
import json
import os
import time
from pathlib import Path


class Peer:
    """One run of a peer: what it shall do, and how much of its time is left.

    Time counts from the start of the process, interpreter and imports included, as it does for
    whoever waits for the picture.
    """

    def __init__(self, description):
        parser = argparse.ArgumentParser(description=description)
        parser.add_argument("scene", type=Path, help="folder written by `eval export`")
        parser.add_argument("--out", type=Path, required=True, help="the EXR to write")
        parser.add_argument("--size", required=True, metavar="WxH")
        parser.add_argument("--seconds", type=float, help="from the start of the process to the file")
        parser.add_argument("--reserve", type=float, default=0.3, help="seconds kept for denoising, writing and leaving")
        parser.add_argument("--spp", type=int, help="in place of --seconds: so many samples per pixel")
        parser.add_argument("--denoise", action="store_true", help="with Open Image Denoise")
        parser.add_argument("--seed", type=int, default=0)
        options = parser.parse_args()
        if (options.seconds is None) == (options.spp is None):
            parser.error("give either --seconds or --spp")
        self.options = options
        self.width, self.height = map(int, options.size.split("x"))
        self.description = json.loads((options.scene / "scene.json").read_text())
        self.camera = self.description["camera"]
        self.meshes = self.description["meshes"]
        self.threads = len(os.sched_getaffinity(0))

    def file(self, name):
        """A file of the exported scene."""
        return str((self.options.scene / name).resolve())

    def left(self):
        """Seconds until the tracing has to end."""
        return self.options.seconds - self.options.reserve - process_age()


def process_age():
    """Seconds since this process was started, as the kernel counts."""
    started = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started / os.sysconf("SC_CLK_TCK")


def is_lamp(mesh):
    """Whether a mesh emits."""
    return any(mesh["emission"])
