"""Walls with their arches and windows: arcade, triforium, clerestory, aisle, ends."""

from piers import colonnette
from plan import (
    AISLE_AXIS,
    AISLE_DIAGONAL,
    AISLE_FACE,
    AISLE_HALF,
    AISLE_HEIGHTS,
    AISLE_TOP,
    AISLE_TRANSVERSE,
    AISLE_WALL_RIB,
    ARCADE_SPRING,
    CLERESTORY,
    FINE_TRACERY,
    FOUNDATION,
    GLASS_SILL,
    HALF_BAY,
    NAVE_WALL,
    OUTER_WALL,
    PANE_DEPTH,
    PIERS,
    SLIM_RIB,
    STRING,
    TRACERY,
    TRACERY_DEPTH,
    TRIFORIUM,
    VAULT_TOP,
    WALL_RIB,
    WALL_RIB_HEIGHTS,
    WINDOW,
    WINDOW_DEPTH,
    WINDOW_SILL,
)
from shapes import Arch, Mesh, arc, bar, evenly, place, roll
from vaulting import boss, ribbed_vault


def arcade():
    """The arch between two piers and the walls above it, up to the triforium."""
    mesh = Mesh()
    arch = Arch(1.98, ARCADE_SPRING, 2.5)
    extrados = HALF_BAY - arch.half_span
    nave_side = [(extrados, -0.55), (0.75, -0.63), (0.68, -0.63), (0.63, -0.55), (0.5, -0.55)]
    nave_side += roll((0.43, -0.48), 0.07, -60.0, -180.0, 3)
    nave_side += [(0.34, -0.4), (0.25, -0.4)]
    soffit = roll((0.2, -0.33), 0.06, -70.0, -190.0, 3) + [(0.12, -0.2), (0.03, -0.2), (0.0, -0.15)]
    aisle_side = [(0.0, 0.15), (0.03, 0.2), (0.12, 0.2), (0.3, 0.4), (0.34, 0.55), (extrados, 0.55)]
    fractions = evenly(8)
    rows = arch.rows(nave_side + soffit + aisle_side, fractions)
    mesh.grid("limestone", place(rows, (0.0, PIERS), (1.0, 0.0)), toward=(0.0, 5.0, PIERS))
    outline = [(a, y) for ((a, y, _),) in arch.rows([(extrados, 0.0)], fractions)]
    for face, towards in ((NAVE_WALL, 0.0), (AISLE_FACE, OUTER_WALL)):
        lower = [(x, y, face) for x, y in outline]
        upper = [(x, TRIFORIUM, face) for x, _ in outline]
        mesh.grid("ashlar", [lower, upper], toward=(0.0, 8.0, towards))
    string_course(mesh, TRIFORIUM, HALF_BAY, NAVE_WALL)
    return mesh


def triforium():
    """Three arches before a dark passage, between the arcade and the clerestory."""
    mesh = Mesh()
    arch = Arch(0.52, 10.95, 0.85)
    section = [(0.16, 0.0), (0.13, -0.03), (0.09, 0.0), (0.06, 0.05), (0.0, 0.09), (0.0, 0.4)]
    sill, floor, back, ceiling = 9.75, 9.72, 6.1, 12.3
    lancets(mesh, arch, (-1.36, 0.0, 1.36), sill, CLERESTORY, HALF_BAY, NAVE_WALL, section, 6, 0.4)
    parapet = [[(x, y, NAVE_WALL) for x in (-HALF_BAY, HALF_BAY)] for y in (TRIFORIUM, sill)]
    mesh.grid("ashlar", parapet, toward=(0.0, sill, 0.0))
    rail = [
        (NAVE_WALL, sill - 0.06),
        (NAVE_WALL - 0.05, sill - 0.05),
        (NAVE_WALL - 0.06, sill),
        (NAVE_WALL + 0.5, sill),
    ]
    mesh.grid(
        "limestone",
        [[(x, y, z) for z, y in rail] for x in (-HALF_BAY, HALF_BAY)],
        toward=(0.0, 20.0, 0.0),
    )
    passage = [(NAVE_WALL, floor), (back, floor), (back, ceiling), (NAVE_WALL, ceiling)]
    rows = [[(x, y, z) for z, y in passage] for x in (-HALF_BAY, HALF_BAY)]
    mesh.grid("ashlar", rows, toward=(0.0, 11.0, 5.5))
    string_course(mesh, CLERESTORY, HALF_BAY, NAVE_WALL)
    return mesh


def clerestory():
    """The wall about a window under the vault: a splay, two lights, a foiled circle."""
    mesh = Mesh()
    heights = [y for y in WALL_RIB_HEIGHTS if y > WINDOW_SILL]
    section = [(0.36, 0.0), (0.3, -0.05), (0.24, 0.0), (0.2, 0.06)]
    section += [(0.0, PANE_DEPTH - 0.05), (0.0, WINDOW_DEPTH)]
    window_wall(mesh, WINDOW, WALL_RIB, heights, WINDOW_SILL, NAVE_WALL, section)
    wall = [[(x, y, NAVE_WALL) for x in (-HALF_BAY, HALF_BAY)] for y in (CLERESTORY, WINDOW_SILL)]
    mesh.grid("ashlar", wall, toward=(0.0, 15.0, 0.0))
    sloping_sill(
        mesh, WINDOW.half_span + 0.36, WINDOW_SILL, GLASS_SILL, NAVE_WALL, PANE_DEPTH + 0.02
    )
    tracery(mesh, WINDOW, GLASS_SILL, NAVE_WALL + TRACERY_DEPTH, steps=5)
    return mesh


def panes(material):
    """The pale glass of a clerestory's window: all of its light comes from here."""
    mesh = Mesh()
    outline = [(a, y) for ((a, y, _),) in WINDOW.rows([(0.0, 0.0)], evenly(6))]
    foot = GLASS_SILL - 0.01
    above = [(x, max(y, foot)) for x, y in outline]
    mesh.polygon(material, [(x, y, NAVE_WALL + PANE_DEPTH) for x, y in above], toward=(0.0, 16.0, 0.0))
    return mesh


def aisle():
    """A bay of the aisle: its vault, and the outer wall with a blind arcade."""
    mesh = Mesh()
    ribbed_vault(
        mesh,
        AISLE_AXIS,
        AISLE_HALF,
        AISLE_DIAGONAL,
        AISLE_TRANSVERSE,
        AISLE_WALL_RIB,
        AISLE_HEIGHTS,
        SLIM_RIB,
        6,
    )
    boss(mesh, (0.0, AISLE_TOP, AISLE_AXIS), 0.22)
    arch = Arch(0.66, 2.3, 0.9)
    section = [(0.16, 0.0), (0.1, 0.02), (0.04, 0.1), (0.0, 0.22)]
    bench, top, back = 0.55, 3.6, OUTER_WALL + 0.22
    lancets(mesh, arch, (-1.64, 0.0, 1.64), bench, top, HALF_BAY, OUTER_WALL, section, 5, 0.22)
    recess = [[(x, y, back) for x in (-HALF_BAY, HALF_BAY)] for y in (bench - 0.1, top)]
    mesh.grid("ashlar", recess, toward=(0.0, 2.0, AISLE_AXIS))
    seat = [(OUTER_WALL - 0.4, 0.0), (OUTER_WALL - 0.4, bench), (back, bench)]
    mesh.grid(
        "limestone",
        [[(x, y, z) for z, y in seat] for x in (-HALF_BAY, HALF_BAY)],
        toward=(0.0, 3.0, 0.0),
    )
    wall = [[(x, y, OUTER_WALL) for x in (-HALF_BAY, HALF_BAY)] for y in (top, AISLE_TOP + 0.1)]
    mesh.grid("ashlar", wall, toward=(0.0, 5.0, AISLE_AXIS))
    string_course(mesh, top + 0.05, HALF_BAY, OUTER_WALL)
    return mesh


def west_wall():
    """The wall behind the camera: it closes nave and aisles, with a door."""
    mesh = Mesh()
    columns = [-FOUNDATION + 2 * FOUNDATION * i / 8 for i in range(9)]
    levels = [-0.1, 4.0, 9.1, 14.2, VAULT_TOP + 0.3]
    rows = [[(0.0, y, z) for z in columns] for y in levels]
    mesh.grid("ashlar", rows, toward=(5.0, 5.0, 0.0))
    arch = Arch(1.5, 0.0, 2.2, stilt=2.6)
    section = [(0.7, -0.02), (0.68, -0.1), (0.56, -0.12), (0.5, -0.05)]
    section += roll((0.38, -0.1), 0.1, 20.0, -200.0, 5) + [(0.2, -0.02)]
    section += roll((0.08, -0.08), 0.09, 20.0, -200.0, 5)
    rows = place(arch.rows(section, evenly(6)), (0.02, 0.0), (0.0, 1.0))
    mesh.grid(
        "limestone",
        [[(-x + 0.04, y, z) for x, y, z in row] for row in rows],
        toward=(3.0, 3.0, 0.0),
    )
    outline = [(0.03, y, a) for ((a, y, _),) in arch.rows([(0.1, 0.0)], evenly(6))]
    mesh.grid("oak", [[(0.03, 0.0, z) for _, _, z in outline], outline], toward=(3.0, 1.0, 0.0))
    for y in (0.6, 1.9, 3.2):
        mesh.box("iron", (0.02, y, -1.45), (0.06, y + 0.09, 1.45))
    return mesh


def east_wall():
    """Closes an aisle and its triforium beside the apse."""
    mesh = Mesh()
    rows = [
        [(0.0, y, z) for z in (NAVE_WALL - 0.05, 7.5, FOUNDATION)]
        for y in (-0.1, 4.5, TRIFORIUM, 12.6)
    ]
    mesh.grid("ashlar", rows, toward=(-5.0, 5.0, 7.0))
    return mesh


def string_course(mesh, height, half_length, face):
    """A moulded band along a wall."""
    rows = [[(x, height + w, face - u) for u, w in STRING] for x in (-half_length, half_length)]
    mesh.grid("limestone", rows, toward=(0.0, height, 0.0))


def lancets(mesh, arch, centres, sill, top, half_length, face, section, sides, depth):
    """A row of arches on small shafts before a recess, in a wall from sill to top.

    `section` begins at the face of the wall. The arches must touch: half the distance
    of their centres is half their span plus the first u of the section.
    """
    margin = section[0][0]
    reach = arch.half_span + margin
    fractions = evenly(4)
    for centre in centres:
        rows = place(arch.rows(section, fractions), (centre, face), (1.0, 0.0))
        mesh.grid("limestone", rows, toward=(centre, sill, face))
        outline = arch.rows([(margin, 0.0)], fractions)
        lower = [(centre + a, y, face) for ((a, y, _),) in outline]
        upper = [(x, top, face) for x, _, _ in lower]
        mesh.grid("ashlar", [lower, upper], toward=(centre, sill, 0.0))
    edge = centres[-1] + reach
    for side in (-1.0, 1.0):
        wall = [[(side * x, y, face) for x in (edge, half_length)] for y in (sill, top)]
        mesh.grid("ashlar", wall, toward=(0.0, sill, 0.0))
        jamb = [[(side * edge, y, face + w) for w in (0.0, depth)] for y in (sill, top)]
        mesh.grid("ashlar", jamb, toward=(0.0, sill, face))
    width = 2 * margin
    middle = face + section[-1][1] / 2
    stands = [centres[0] - reach + margin / 2] + [c + reach for c in centres[:-1]]
    stands += [centres[-1] + reach - margin / 2]
    for x in stands:
        colonnette(mesh, (x, middle), sill, arch.spring, 0.085, sides)
        low = (x - width / 2, arch.spring - 0.09, face - 0.03)
        mesh.box("limestone", low, (x + width / 2, arch.spring, face + section[-1][1] + 0.02))


def window_wall(mesh, window, rib, heights, sill, face, section):
    """The wall between a window and the wall rib above it, and the window's jambs.

    `heights` are those of the vault's courses on the wall, so that the wall ends
    exactly where the vault begins.
    """
    rise = rib.apex - window.base
    fractions = [0.0] + [(y - window.base) / rise for y in heights if y > window.base]
    rows = place(window.rows(section, fractions), (0.0, face), (1.0, 0.0))
    mesh.grid("limestone", rows, toward=(0.0, window.base, face - 1.0))
    margin = section[0][0]
    outer = [(rib.half_span, sill), (rib.half_span, window.base)]
    outer = sorted(set(outer + [(rib.x_at(y), y) for y in heights]), key=lambda p: p[1])
    inner = []
    for _, y in outer:
        inner.append(
            (window.half_span + margin, y)
            if y <= window.base
            else window.at((y - window.base) / rise, margin)
        )
    for side in (-1.0, 1.0):
        strip = [[(side * x, y, face) for x, y in line] for line in (inner, outer)]
        mesh.grid("ashlar", strip, toward=(0.0, window.base, 0.0))


def sloping_sill(mesh, half_width, low, high, face, depth):
    """The slope below a window that throws its light down."""
    rows = [[(x, low, face), (x, high, face + depth)] for x in (-half_width, half_width)]
    mesh.grid("limestone", rows, toward=(0.0, 30.0, 0.0))


def tracery(mesh, window, foot, depth, steps):
    """Two lights under a circle with four foils, all in bars."""
    half = window.half_span
    light = half / 2
    small = Arch(light, window.base - 0.15, light * 1.25)
    centre = (0.0, window.base + 0.62 * half)
    radius = 0.46 * half
    paths = [[(0.0, foot - 0.2), (0.0, window.base + 0.1)]]
    for side in (-1.0, 1.0):
        outline = small.rows([(0.0, 0.0)], evenly(steps))
        paths.append([(side * light + a, y) for ((a, y, _),) in outline])
    paths.append(arc(centre, radius, 0.0, 360.0, 3 * steps))
    away = (0.0, window.base, depth + 0.3)
    for path in paths:
        mesh.grid("limestone", bar(path, TRACERY, depth), closed=True, away=away)
    for k in range(4):
        angle = 90.0 * k
        x, y = arc(centre, 0.5 * radius, angle, angle, 1)[0]
        foil = arc((x, y), 0.42 * radius, angle - 130.0, angle + 130.0, steps)
        mesh.grid("limestone", bar(foil, FINE_TRACERY, depth), closed=True, away=away)
    # Iron bars across the lights hold the glass.
    height = foot + 0.7
    while height < window.base:
        low, high = (-half, height - 0.015, depth + 0.08), (half, height + 0.015, depth + 0.11)
        rows = [[(x, y, low[2]) for y in (low[1], high[1])] for x in (low[0], high[0])]
        mesh.grid("iron", rows, toward=(0.0, 0.0, -100.0))
        height += 0.7
