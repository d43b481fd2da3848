"""The apse: five sides of a decagon with tall windows under a vault of their own."""

from plan import (
    APSE_GLASS_DEPTH,
    APSE_HALF,
    APSE_RIB,
    APSE_SILL,
    APSE_WALL,
    APSE_WINDOW,
    NAVE_WALL,
    RIB,
    SHAFT_BASE,
    TRANSVERSE,
    VAULT_RISE,
    VAULT_SPRING,
    capital,
)
from shapes import Arch, Mesh, cluster, evenly, mix, place
from vaulting import web
from walls import lancets, sloping_sill, string_course, tracery, window_wall


def apse_side():
    """One side of the apse, with its tall window and its part of the vault."""
    mesh = Mesh()
    scale = APSE_RIB.apex - VAULT_SPRING
    heights = TRANSVERSE.heights(11)
    wall_heights = [VAULT_SPRING + (y - VAULT_SPRING) * scale / VAULT_RISE for y in heights]
    for side in (-1.0, 1.0):
        rib, edge = [], []
        for y, low in zip(heights, wall_heights):
            t = TRANSVERSE.x_at(y) / NAVE_WALL
            rib.append((side * APSE_HALF * t, y, APSE_WALL * t))
            edge.append((side * APSE_RIB.x_at(low), low, APSE_WALL))
        web(mesh, rib, edge)
    section = [(0.3, 0.0), (0.25, -0.05), (0.2, 0.0), (0.15, 0.04), (0.0, 0.3), (0.0, 0.6)]
    sill = APSE_WINDOW.spring
    window_wall(
        mesh, APSE_WINDOW, APSE_RIB, [VAULT_SPRING] + wall_heights[1:], sill, APSE_WALL, section
    )
    sloping_sill(mesh, APSE_WINDOW.half_span + 0.3, sill, APSE_SILL, APSE_WALL, 0.6)
    tracery(mesh, APSE_WINDOW, APSE_SILL, APSE_WALL + 0.35, steps=5)
    half = [(0.02, -0.1), (-0.07, -0.1), (-0.12, 0.02)]
    mesh.grid(
        "limestone",
        place(APSE_RIB.rows(half, evenly(6)), (0.0, APSE_WALL), (1.0, 0.0)),
        toward=(0.0, 15.0, 0.0),
    )
    arch = Arch(0.46, 2.4, 0.75)
    blind = [(0.14, 0.0), (0.08, 0.02), (0.03, 0.1), (0.0, 0.2)]
    top = sill - 0.2
    lancets(mesh, arch, (-0.6, 0.6), 0.0, top, APSE_HALF, APSE_WALL, blind, 6, 0.2)
    back = [[(x, y, APSE_WALL + 0.2) for x in (-APSE_HALF, APSE_HALF)] for y in (0.0, top)]
    mesh.grid("ashlar", back, toward=(0.0, 2.0, 0.0))
    band = [[(x, y, APSE_WALL) for x in (-APSE_HALF, APSE_HALF)] for y in (top, sill)]
    mesh.grid("ashlar", band, toward=(0.0, 2.0, 0.0))
    string_course(mesh, top + 0.05, APSE_HALF, APSE_WALL)
    return mesh


def apse_rib():
    """A corner of the apse: a shaft from the floor and the rib to the keystone."""
    mesh = Mesh()
    discs = [
        (-0.17, NAVE_WALL, 0.09, 3),
        (0.0, NAVE_WALL - 0.09, 0.14, 6),
        (0.17, NAVE_WALL, 0.09, 3),
    ]
    profile = [(0.1, 0.3), (0.1, 0.7)] + [(d * 0.7, 0.7 + y) for d, y in SHAFT_BASE]
    profile += [(0.0, 4.0), (0.04, 4.03), (0.04, 4.1), (0.0, 4.13)]
    profile += capital(VAULT_SPRING - 0.4, VAULT_SPRING)
    rows = cluster(discs, profile, (150.0, 390.0))
    mesh.grid("limestone", rows, away=(0.0, 9.0, NAVE_WALL + 0.5))
    mesh.polygon("limestone", rows[-1], toward=(0.0, 20.0, NAVE_WALL))
    arch = TRANSVERSE.rows(RIB, evenly(10))
    half = place(arch[: len(arch) // 2 + 1], (0.0, 0.0), (0.0, 1.0))
    mesh.grid("limestone", half, toward=(0.0, 0.0, 0.0))
    return mesh


def apse_glass():
    """Stained glass of one window of the apse; it glows, facing inwards."""
    mesh = Mesh()
    depth = APSE_WALL + APSE_GLASS_DEPTH
    half = APSE_WINDOW.half_span + 0.02
    inside = (0.0, 10.0, 0.0)

    def pane(colour, corners):
        mesh.polygon(f"glass_{colour}", [(x, y, depth) for x, y in corners], toward=inside)

    def rectangle(colour, x0, y0, x1, y1):
        pane(colour, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])

    rows = 11
    foot, top = APSE_SILL - 0.1, APSE_WINDOW.base
    step = (top - foot) / rows
    for light, (left, right) in enumerate(((-half, 0.0), (0.0, half))):
        x0, x1 = left + 0.13, right - 0.13
        xm = (x0 + x1) / 2
        for k in range(rows):
            y0, y1 = foot + k * step, foot + (k + 1) * step
            ym = (y0 + y1) / 2
            even = (k + light) % 2 == 0
            for a, b in ((left, x0), (x1, right)):
                rectangle("ruby", a, y0, b, ym)
                rectangle("gold" if even else "green", a, ym, b, y1)
            for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)):
                pane("blue", [(x, y), (x, ym), (xm, y)])
            diamond = [(x0, ym), (xm, y0), (x1, ym), (xm, y1)]
            jewel = [mix((xm, ym), p, 0.8) for p in diamond]
            for a in range(4):
                b = (a + 1) % 4
                pane("pale", [diamond[a], diamond[b], jewel[b], jewel[a]])
            pane("ruby" if even else "azure", jewel)
    crown = APSE_WINDOW.apex + 0.05
    rectangle("blue", -half, top, half, crown)
    return mesh
