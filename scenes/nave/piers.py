"""Piers, the shafts on the walls, and other upright stones."""

from math import cos, pi, sin

from plan import (
    AISLE_AXIS,
    AISLE_TRANSVERSE,
    ARCADE_SPRING,
    CLERESTORY,
    NAVE_WALL,
    OUTER_WALL,
    PIERS,
    SHAFT_BASE,
    SLIM_RIB,
    TRIFORIUM,
    VAULT_SPRING,
    capital,
)
from shapes import Mesh, cluster, evenly, place, turned


def pier():
    """A pier with its aisle respond and transverse rib, and the shafts up to the vault."""
    mesh = Mesh()
    axis = (0.0, 3.0, PIERS)
    discs = []
    for k in range(8):
        reach, radius, sides = ((0.46, 0.2, 5), (0.42, 0.16, 3))[k % 2]
        angle = k * pi / 4
        discs.append((reach * cos(angle), PIERS + reach * sin(angle), radius, sides))
    plinth = 0.3
    base = [(d, plinth + y) for d, y in SHAFT_BASE]
    rows = cluster(discs, base + capital(4.75, ARCADE_SPRING))
    mesh.grid("pier", rows, away=axis)
    mesh.polygon("pier", rows[-1][:-1], toward=(0.0, 9.0, PIERS))
    octagon = turned(
        (0.0, PIERS), [(1.0, 0.0), (1.0, 0.22), (0.93, plinth), (0.0, plinth)], 8, 22.5, 382.5
    )
    mesh.grid("pier", octagon, away=(0.0, 0.0, PIERS))
    vault_shafts(mesh)
    respond(mesh)
    ring = AISLE_TRANSVERSE.rows(SLIM_RIB, evenly(7))
    mesh.grid(
        "limestone", place(ring, (0.0, AISLE_AXIS), (0.0, 1.0)), toward=(0.0, 0.0, AISLE_AXIS)
    )
    return mesh


def vault_shafts(mesh):
    """Three shafts on the wall, from the pier's capital to the springing of the vault."""
    discs = [
        (-0.24, NAVE_WALL, 0.1, 3),
        (0.0, NAVE_WALL - 0.08, 0.18, 6),
        (0.24, NAVE_WALL, 0.1, 3),
    ]
    foot = [(d * 0.7, ARCADE_SPRING + y) for d, y in SHAFT_BASE]
    # Shaft rings bind them to the wall at the string courses.
    rings = [
        (d, level + y)
        for level in (TRIFORIUM, CLERESTORY - 0.05)
        for d, y in ((0.0, -0.1), (0.05, -0.06), (0.05, 0.04), (0.0, 0.1))
    ]
    head = capital(VAULT_SPRING - 0.4, VAULT_SPRING)
    rows = cluster(discs, foot + rings[:4] + head, (150.0, 390.0))
    mesh.grid("limestone", rows, away=(0.0, 9.0, NAVE_WALL + 0.5))
    mesh.polygon("limestone", rows[-1], toward=(0.0, 20.0, NAVE_WALL))


def respond(mesh):
    """The half shaft on the outer wall that carries the vault of the aisle."""
    profile = [(0.36, 0.0), (0.36, 0.3)] + [(0.22 + d, 0.3 + y) for d, y in SHAFT_BASE[::2]]
    profile += [(0.22 + d, y) for d, y in capital(ARCADE_SPRING - 0.6, ARCADE_SPRING)[::3]]
    profile += [(0.36, ARCADE_SPRING), (0.0, ARCADE_SPRING)]
    rows = turned((0.0, OUTER_WALL), profile, 7, 180.0, 360.0)
    mesh.grid("pier", rows, away=(0.0, 2.0, OUTER_WALL))


def colonnette(mesh, axis, foot, top, radius, sides):
    """A small free shaft with base and capital."""
    profile = [
        (1.7 * radius, foot),
        (1.6 * radius, foot + 0.07),
        (radius, foot + 0.13),
        (radius, top - 0.34),
        (1.3 * radius, top - 0.31),
        (1.05 * radius, top - 0.28),
        (1.7 * radius, top - 0.08),
    ]
    mesh.grid("pier", turned(axis, profile, sides), away=(axis[0], (foot + top) / 2, axis[1]))
