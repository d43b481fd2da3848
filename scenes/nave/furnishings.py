"""What stands and hangs in the nave: floor, steps, altar, benches, banners, lights."""

from math import cos, pi, sin

from dice import Dice
from plan import BAY, FOUNDATION, HALF_BAY, NAVE_WALL
from shapes import Mesh, turned

SLABS = 6  # along a bay
CHOIR_HEIGHT = 0.45
CHOIR_START = 26.6  # from the west wall


def tint(dice, dark):
    """The material of a slab: dark or light, each in two tints."""
    return (
        ("floor_dark", "floor_black")[dice.throw(2)]
        if dark
        else ("floor_light", "floor_pale")[dice.throw(2)]
    )


def floor():
    """A bay of the floor through nave and aisles, a chequer of slabs."""
    mesh = Mesh()
    dice = Dice(7)
    size = BAY / SLABS
    across = 24
    width = 2 * FOUNDATION / across
    for i in range(SLABS):
        for j in range(across):
            x, z = -HALF_BAY + i * size, -FOUNDATION + j * width
            corners = [
                (x, 0.0, z),
                (x + size, 0.0, z),
                (x + size, 0.0, z + width),
                (x, 0.0, z + width),
            ]
            mesh.polygon(tint(dice, (i + j) % 2 == 1), corners, toward=(0.0, 5.0, 0.0))
    return mesh


def choir():
    """Three steps, the raised floor, and the altar; x = 0 is the centre of the apse."""
    mesh = Mesh()
    start = CHOIR_START - 6 * BAY
    half = NAVE_WALL - 0.1
    rise = CHOIR_HEIGHT / 3
    for k in range(3):
        low = (start - 0.38 * (2 - k), k * rise, -half)
        mesh.box("limestone", low, (1.0, (k + 1) * rise - (0.001 if k == 2 else 0.0), half))
    dice = Dice(3)
    top = CHOIR_HEIGHT
    size = 0.7
    columns = 13
    width = 2 * half / columns
    for i in range(int((0.7 - start) / size) + 1):
        for j in range(columns):
            x, z = start + 0.15 + i * size, -half + j * width
            corners = [
                (x, top, z),
                (x + size, top, z),
                (x + size, top, z + width),
                (x, top, z + width),
            ]
            mesh.polygon(tint(dice, (i + j) % 2 == 1), corners, toward=(0.0, 5.0, 0.0))
    # The apse's own floor is a fan under its walls.
    fan = []
    for k in range(6):
        angle = -pi / 2 + k * pi / 5
        fan.append(((NAVE_WALL + 0.3) * cos(angle), top - 0.002, (NAVE_WALL + 0.3) * sin(angle)))
    mesh.polygon("floor_light", fan, toward=(0.0, 5.0, 0.0))
    altar(mesh, 1.3, top)
    return mesh


def altar(mesh, x, floor_height):
    """A table under a cloth on a step of its own, with six candlesticks."""
    step = floor_height + 0.16
    mesh.box("limestone", (x - 1.0, floor_height - 0.05, -2.1), (x + 1.0, step, 2.1))
    mesh.box("banner_red", (x - 0.45, step - 0.02, -1.3), (x + 0.45, step + 0.95, 1.3))
    mesh.box("linen", (x - 0.5, step + 0.9, -1.4), (x + 0.5, step + 1.0, 1.4))
    mesh.box("gilding", (x - 0.46, step + 0.05, -0.12), (x - 0.44, step + 0.8, 0.12))
    mesh.box("gilding", (x - 0.46, step + 0.45, -0.35), (x - 0.44, step + 0.65, 0.35))
    stick = [
        (0.11, 0.0),
        (0.1, 0.03),
        (0.03, 0.08),
        (0.05, 0.16),
        (0.025, 0.24),
        (0.025, 0.5),
        (0.07, 0.55),
        (0.03, 0.55),
    ]
    for z in (-1.2, -0.8, -0.4, 0.4, 0.8, 1.2):
        foot = step + 1.0
        axis = (x + 0.25, z)
        mesh.grid(
            "gilding",
            turned(axis, [(r, foot + y) for r, y in stick], 8),
            away=(axis[0], foot + 0.3, z),
        )
        candle = [(0.025, foot + 0.55), (0.025, foot + 0.95), (0.0, foot + 0.96)]
        mesh.grid("linen", turned(axis, candle, 6), away=(axis[0], foot + 0.7, z))


def benches():
    """The benches of one bay on both sides of the middle aisle, facing east."""
    mesh = Mesh()
    for z0, z1 in ((1.15, 4.15), (-4.15, -1.15)):
        for k in range(5):
            bench(mesh, -HALF_BAY + 0.55 + 1.1 * k, z0, z1)
    return mesh


def bench(mesh, x, z0, z1):
    """A bench: seat, back with a rail, foot rest, two ends."""
    mesh.box("oak", (x - 0.2, 0.4, z0), (x + 0.22, 0.45, z1))
    back = [(x - 0.2, 0.42), (x - 0.3, 0.92), (x - 0.26, 0.93), (x - 0.16, 0.43)]
    rows = [[(a, y, z) for a, y in back] for z in (z0, z1)]
    mesh.grid("oak", rows, closed=True, away=(x - 0.23, 0.67, (z0 + z1) / 2))
    mesh.box("oak", (x - 0.33, 0.9, z0), (x - 0.23, 0.95, z1))
    mesh.box("oak", (x - 0.48, 0.18, z0), (x - 0.36, 0.23, z1))
    for z in (z0 - 0.06, z1):
        bench_end(mesh, x, z)


def bench_end(mesh, x, z):
    """A board with a rounded shoulder and a poppy head."""
    outline = [(-0.38, 0.0), (0.26, 0.0), (0.26, 0.5), (0.2, 0.58), (-0.08, 0.64), (-0.18, 0.78)]
    outline += [
        (-0.19, 1.0),
        (-0.15, 1.08),
        (-0.2, 1.17),
        (-0.28, 1.2),
        (-0.36, 1.17),
        (-0.41, 1.08),
        (-0.37, 1.0),
    ]
    faces = [[(x + a, y, zz) for a, y in outline] for zz in (z, z + 0.06)]
    mesh.grid("oak", faces, closed=True, away=(x - 0.2, 0.5, z + 0.03))
    for row, side in zip(faces, (-1.0, 1.0)):
        # In two parts: the board is not convex.
        mesh.polygon("oak", row[:5] + row[12:], toward=(x, 0.5, z + side))
        mesh.polygon("oak", row[4:13], toward=(x, 0.5, z + side))


def banner(colour):
    """A swallow-tailed banner on a pole that stands out from the wall at z = NAVE_WALL."""
    mesh = Mesh()
    z0, z1, top, drop = 3.0, 4.35, 0.0, 3.6
    columns, rows = 8, 10
    trim = "gilding"
    grid = []
    for i in range(rows + 1):
        row = []
        for j in range(columns + 1):
            s, t = j / columns, i / rows
            wave = 0.07 * t * sin(2.2 * pi * s + 2.0 * t) + 0.05 * t * t
            tail = 0.55 * (1 - abs(2 * s - 1)) * t * t
            row.append((wave, top - drop * t + tail, z0 + (z1 - z0) * s))
        grid.append(row)
    away = (-3.0, -2.0, 3.7)
    mesh.grid(colour, [row[1:-1] for row in grid[:-1]], toward=away)
    mesh.grid(trim, [row[:2] for row in grid], toward=away)
    mesh.grid(trim, [row[-2:] for row in grid], toward=away)
    mesh.grid(trim, [row[1:-1] for row in grid[-2:]], toward=away)
    pole = turned((0.0, 0.0), [(0.03, z0 - 0.15), (0.03, NAVE_WALL), (0.0, NAVE_WALL)], 6)
    mesh.grid("iron", [[(x, top + z, y) for x, y, z in row] for row in pole], away=(0.0, top, 4.0))
    knob = turned(
        (0.0, 0.0), [(0.0, -0.07), (0.05, -0.05), (0.07, 0.0), (0.05, 0.05), (0.0, 0.07)], 7
    )
    mesh.grid(
        trim,
        [[(x, top + z, z0 - 0.15 + y) for x, y, z in row] for row in knob],
        away=(0.0, top, z0 - 0.15),
    )
    return mesh


def corona():
    """A ring of candles that hangs from the vault on three chains; y = 0 is the ring."""
    mesh = Mesh()
    ring = [(1.1, -0.12), (1.14, -0.12), (1.14, 0.12), (1.1, 0.12), (1.1, -0.12)]
    mesh.grid("gilding", turned((0.0, 0.0), ring, 24), away=(0.0, 0.0, 0.0))
    for k in range(12):
        angle = k * pi / 6
        axis = (1.12 * cos(angle), 1.12 * sin(angle))
        mesh.grid(
            "iron",
            turned(axis, [(0.02, 0.1), (0.08, 0.16), (0.03, 0.16)], 6),
            away=(axis[0], 0.0, axis[1]),
        )
        candle = [(0.03, 0.15), (0.03, 0.42), (0.0, 0.43)]
        mesh.grid("linen", turned(axis, candle, 6), away=(axis[0], 0.3, axis[1]))
    for k in range(3):
        angle = k * 2 * pi / 3 + 0.4
        foot = (1.12 * cos(angle), 0.1, 1.12 * sin(angle))
        chain(mesh, foot, (0.0, 2.2, 0.0))
    chain(mesh, (0.0, 2.2, 0.0), (0.0, 12.0, 0.0))
    return mesh


def chain(mesh, low, high):
    """A thin three-sided rod between two points."""
    offsets = [(0.014 * cos(a), 0.014 * sin(a)) for a in (0.0, 2 * pi / 3, 4 * pi / 3)]
    rows = [[(x + a, y, z + b) for a, b in offsets] for x, y, z in (low, high)]
    middle = tuple((p + q) / 2 for p, q in zip(low, high))
    mesh.grid("iron", rows, closed=True, away=middle)
