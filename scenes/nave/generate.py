#!/usr/bin/env python3
"""Builds the nave: a vaulted church that is lit through its clerestory.

Writes one OBJ for each module, the texture of the walls, and nave.toml, which puts
the modules together, into the folder given (default: where this file is). Only the
standard library is used, and the same bytes come out everywhere; the tests compare.
"""

import sys
from pathlib import Path

import apse
import furnishings
import piers
import texture
import vaulting
import walls
from plan import BAY, HALF_BAY

BAYS = 6
EAST = BAYS * BAY  # where the apse begins

CAMERA = """\
[camera]
eye = [1.3, 1.85, -0.9]
look_at = [20.0, 6.3, 0.25]
up = [0.0, 1.0, 0.0]
vertical_fov_degrees = 58.0

[image]
width = 1024
height = 768
"""

MODULES = {
    "pier": (piers.pier, "A pier, its shafts up to the vault, the respond in the aisle."),
    "arcade": (walls.arcade, "The arch between two piers."),
    "triforium": (walls.triforium, "Three arches before a passage."),
    "clerestory": (walls.clerestory, "The wall about a window under the vault."),
    "panes-south": (lambda: walls.panes("glass_sun"), "The glass of a window, with sun behind."),
    "panes-north": (lambda: walls.panes("glass_sky"), "The glass of a window, with sky behind."),
    "vault": (vaulting.vault, "The ribbed vault over a bay of the nave."),
    "transverse-rib": (vaulting.transverse_rib, "The arch between two bays of the vault."),
    "aisle": (walls.aisle, "A bay of the aisle with its vault and outer wall."),
    "apse-side": (apse.apse_side, "One of five sides of the apse."),
    "apse-rib": (apse.apse_rib, "A shaft and rib of the apse."),
    "apse-glass": (apse.apse_glass, "Stained glass of a window of the apse."),
    "west-wall": (walls.west_wall, "The wall with the door."),
    "east-wall": (walls.east_wall, "Closes an aisle beside the apse."),
    "floor": (furnishings.floor, "The floor of a bay."),
    "choir": (furnishings.choir, "Steps, floor of choir and apse, altar."),
    "benches": (furnishings.benches, "The benches of a bay."),
    "banner-red": (lambda: furnishings.banner("banner_red"), "A banner on a pole."),
    "banner-blue": (lambda: furnishings.banner("banner_blue"), "A banner on a pole."),
    "corona": (furnishings.corona, "A ring of candles."),
}


def mesh(name, x=0.0, y=0.0, turn=0.0):
    """A [[mesh]] entry: a module moved to x, y and turned about the upright axis."""
    entry = f'\n[[mesh]]\npath = "{name}.obj"\n'
    if turn:
        entry += f"rotate_degrees = [0.0, {turn}, 0.0]\n"
    if x or y:
        entry += f"translate = [{x}, {y}, 0.0]\n"
    return entry


def both_sides(name, x, y=0.0):
    """A module on the south side and, turned round, on the north side."""
    return mesh(name, x, y) + mesh(name, x, y, turn=180.0)


def building():
    """All the [[mesh]] entries, from west to east."""
    parts = [mesh("west-wall")]
    for k in range(BAYS + 1):
        parts.append(both_sides("pier", k * BAY))
        parts.append(mesh("transverse-rib", k * BAY))
    for k in range(BAYS):
        x = k * BAY + HALF_BAY
        parts += [mesh("floor", x), mesh("vault", x)]
        parts += [both_sides(name, x) for name in ("arcade", "triforium", "clerestory", "aisle")]
        parts += [mesh("panes-south", x), mesh("panes-north", x, turn=180.0)]
    for k in range(5):
        turn = 18.0 + 36.0 * k
        parts += [mesh("apse-side", EAST, turn=turn), mesh("apse-glass", EAST, turn=turn)]
    parts += [mesh("apse-rib", EAST, turn=36.0 * k) for k in range(1, 5)]
    parts += [both_sides("east-wall", EAST), mesh("choir", EAST)]
    parts += [mesh("benches", k * BAY + HALF_BAY) for k in (2, 3)]
    for k in (2, 3, 4):
        parts.append(both_sides("banner-red" if k % 2 else "banner-blue", k * BAY, 8.4))
    parts += [mesh("corona", k * BAY + HALF_BAY, 6.6) for k in (2, 4)]
    return "".join(parts)


def scene():
    """The text of nave.toml."""
    head = "# A vaulted nave, lit through its clerestory. Written by generate.py.\n\n"
    return head + CAMERA + building()


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent)
    for name, (build, title) in MODULES.items():
        (folder / f"{name}.obj").write_text(build().obj(title), encoding="ascii", newline="\n")
    (folder / "ashlar.png").write_bytes(texture.ashlar())
    (folder / "nave.toml").write_text(scene(), encoding="ascii", newline="\n")


if __name__ == "__main__":
    main()
