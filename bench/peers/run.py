#!/usr/bin/env python3
"""Compares Gridlight with other renderers at equal total time on this machine.

Every renderer gets the same scene, size and time from the start of its process to its file. Prints a
Markdown table and writes it with a contact sheet. What is not installed is left out, aloud.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SCENES = {
    "cornell-box": ROOT / "scenes/cornell-box/cornell-box.toml",
    "conference": ROOT / "scenes/conference.toml",
    "sibenik": ROOT / "scenes/sibenik.toml",
    "sponza": ROOT / "scenes/sponza.toml",
    "living-room": ROOT / "scenes/living-room.toml",
}
PEERS = {"mitsuba": "Mitsuba 3", "cycles": "Cycles", "luxcore": "LuxCore"}
# What a run may take beyond its time before it is repeated with more in reserve, and how often.
OVER_MAX = 1.02
UNDER_MIN = 0.93
TRIES = 4
# Both sides' converged pictures must have the same mean light to this part, lamps left out.
AGREE_WITHIN = 0.01
# Brighter values are lamps, whose edges' pixels decide a mean.
LAMP = 1.5


@dataclass
class Entrant:
    """A renderer in one of its settings."""

    name: str
    command: list
    # Seconds that it needs after its tracing, learnt from its runs.
    reserve: dict = field(default_factory=dict)


@dataclass
class Row:
    scene: str
    size: str
    seconds: float
    entrant: str
    wall_s: float
    relmse: float
    flip: float
    picture: Path


def main():
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)
    entrants = gridlight(options) + [peer for name in options.peers for peer in installed(options, name)]
    rows = []
    for scene in options.scenes:
        exported = export(options, scene)
        if exported is None:
            continue
        for size in options.sizes:
            gold = reference(options, scene, exported, size)
            if gold is None:
                continue
            for seconds in options.seconds:
                for entrant in entrants:
                    rows.append(measure(options, entrant, scene, exported, size, seconds, gold))
            contact_sheet(options, scene, size, gold, rows)
            (options.out / "table.md").write_text(table(rows))
    print(table(rows))


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", type=Path, default=HERE / "venv/bin/python", help="an interpreter with requirements.txt installed")
    parser.add_argument("--bin", type=Path, default=Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug", help="folder of master and eval")
    parser.add_argument("--out", type=Path, default=ROOT / "target/peers", help="pictures, references, table.md, contact sheets")
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--sizes", nargs="+", default=["512x384", "1024x768"], metavar="WxH")
    parser.add_argument("--seconds", nargs="+", type=float, default=[2, 4, 8], metavar="S")
    parser.add_argument("--peers", nargs="*", default=list(PEERS), choices=list(PEERS))
    parser.add_argument("--flags", default="", help="more flags for master")
    parser.add_argument("--paper", action="store_true", help="measure `master --paper` too")
    parser.add_argument("--reference-spp", type=int, default=2048, help="paths per pixel of each side's reference")
    options = parser.parse_args()
    for program in ("master", "eval"):
        if not (options.bin / program).is_file():
            parser.error(f"{options.bin / program} is not there; run `cargo build -p master -p eval`, or give --bin")
    return options


def gridlight(options):
    master = [str(options.bin / "master"), "--no-png", "-q", *shlex.split(options.flags)]
    entrants = [Entrant("Gridlight", master)]
    if options.paper:
        entrants.append(Entrant("Gridlight --paper", [*master, "--paper"]))
    return entrants


def installed(options, name):
    module = {"mitsuba": "mitsuba", "cycles": "bpy", "luxcore": "pyluxcore"}[name]
    try:
        found = subprocess.run([options.python, "-c", f"import {module}"], capture_output=True, timeout=120)
        why = found.stderr.decode().strip().rsplit("\n", 1)[-1]
    except OSError as error:
        found, why = None, str(error)
    if found is None or found.returncode:
        say(f"SKIPPED: {PEERS[name]}: {why}; see README.md")
        return []
    command = [str(options.python), str(HERE / f"{name}_peer.py")]
    return [Entrant(PEERS[name], command), Entrant(f"{PEERS[name]} + OIDN", [*command, "--denoise"])]


def export(options, scene):
    folder = options.out / "scenes" / scene
    done = subprocess.run([options.bin / "eval", "export", SCENES[scene], "--out", folder], capture_output=True, text=True)
    if done.returncode:
        say(f"SKIPPED: {scene}: {done.stderr.strip()}")
        return None
    return folder


def reference(options, scene, exported, size):
    """The mean of a converged picture of ours and one of Mitsuba's, which must agree first."""
    folder = options.out / "references"
    folder.mkdir(exist_ok=True)
    stem = f"{scene}-{size}-{options.reference_spp}"
    ours, theirs, both = (folder / f"{stem}-{side}.exr" for side in ("ours", "mitsuba", "both"))
    if both.is_file():
        return both
    say(f"{scene} {size}: making references with {options.reference_spp} paths per pixel")
    if not ours.is_file():
        run([options.bin / "master", "--no-png", "-q", "--integrator", "path", "--no-deadline", "--spp", options.reference_spp,
             "--scene", SCENES[scene], "--size", size, "--seed", 77, "--out", ours])
    if not theirs.is_file():
        run([options.python, HERE / "mitsuba_peer.py", exported, "--size", size, "--spp", options.reference_spp, "--seed", 7, "--out", theirs])
    means = [mean_without_lamps(path) for path in (ours, theirs)]
    say(f"{scene} {size}: mean light of the references {means[0]:.5f} (ours) and {means[1]:.5f} (Mitsuba)")
    if abs(means[0] / means[1] - 1) > AGREE_WITHIN:
        say(f"SKIPPED: {scene} {size}: the references disagree")
        return None
    run(["oiiotool", ours, "--ch", "R,G,B", theirs, "--ch", "R,G,B", "--add", "--mulc", 0.5, "-o", both])
    return both


def mean_without_lamps(path):
    done = run(["oiiotool", path, "--ch", "R,G,B", "--clamp:max=%g" % LAMP, "--echo", "{TOP.AVGCOLOR}"])
    return sum(map(float, done.stdout.strip().split(",")))


def measure(options, entrant, scene, exported, size, seconds, gold):
    name = entrant.name.lower().replace(" ", "-").replace("+", "with")
    picture = options.out / f"{scene}-{size}-{seconds:g}s-{name}.exr"
    for attempt in range(TRIES):
        if entrant.name.startswith("Gridlight"):
            command = [*entrant.command, "--scene", SCENES[scene], "--size", size, "--deadline", seconds, "--out", picture]
        else:
            reserve = entrant.reserve.get(size, 0.3)
            command = [*entrant.command, exported, "--size", size, "--seconds", seconds, "--reserve", reserve, "--out", picture]
        begun = time.monotonic()
        run(command)
        wall = time.monotonic() - begun
        if entrant.name.startswith("Gridlight") or UNDER_MIN * seconds <= wall <= OVER_MAX * seconds:
            break
        # Next time so much more or less is kept.
        entrant.reserve[size] = max(0.0, reserve + wall - 0.98 * seconds)
    judged = run([options.bin / "eval", "compare", gold, picture, "--json"])
    scores = json.loads(judged.stdout)["images"][0]
    say(f"{scene} {size} {seconds:g} s {entrant.name}: {wall:.2f} s, relMSE {scores['relmse']:.5f}, FLIP {scores['flip']:.4f}")
    return Row(scene, size, seconds, entrant.name, wall, scores["relmse"], scores["flip"], picture)


def run(command):
    command = [str(word) for word in command]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{shlex.join(command)} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return done


def table(rows):
    lines = [
        "| Scene | Size | Time | Renderer | Took | relMSE | of the best peer's | FLIP | of the best peer's |",
        "| --- | --- | --: | --- | --: | --: | --: | --: | --: |",
    ]
    for row in rows:
        peers = [r for r in rows if same_cell(r, row) and not r.entrant.startswith("Gridlight")]

        def ratio(metric):
            if not peers or not row.entrant.startswith("Gridlight"):
                return ""
            return f"{getattr(row, metric) / min(getattr(peer, metric) for peer in peers):.2f}"

        lines.append(
            f"| {row.scene} | {row.size} | {row.seconds:g} s | {row.entrant} | {row.wall_s:.2f} s "
            f"| {row.relmse:.5f} | {ratio('relmse')} | {row.flip:.4f} | {ratio('flip')} |"
        )
    return "\n".join(lines) + "\n"


def same_cell(a, b):
    return (a.scene, a.size, a.seconds) == (b.scene, b.size, b.seconds)


def contact_sheet(options, scene, size, gold, rows):
    """All pictures of a scene: a row of the sheet for each time, the reference last."""
    here = [row for row in rows if (row.scene, row.size) == (scene, size)]
    columns = len({row.entrant for row in here}) + 1
    command, sheet_rows = ["oiiotool"], 0
    for seconds in options.seconds:
        cells = [(row.picture, f"{row.entrant}, {seconds:g} s") for row in here if row.seconds == seconds]
        for picture, text in [*cells, (gold, "reference")]:
            command += [picture, "--ch", "R,G,B", "--resize", "512x0", "--clamp:min=0:max=1", "--powc", 1 / 2.2,
                        "--text:x=8:y=24:size=20:color=1,1,0", text]
        sheet_rows += 1
    run([*command, f"--mosaic:pad=4", f"{columns}x{sheet_rows}", "-d", "uint8", "-o", options.out / f"{scene}-{size}.jpg"])


def say(text):
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
