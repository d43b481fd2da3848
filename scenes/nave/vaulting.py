"""Ribbed vaults: webs ruled between ribs, the ribs, the keystones."""

from math import dist

from plan import (
    DIAGONAL,
    HALF_BAY,
    NAVE_WALL,
    RIB,
    TRANSVERSE,
    VAULT_TOP,
    WALL_RIB,
    WALL_RIB_HEIGHTS,
)
from shapes import ASHLAR_HEIGHT, ASHLAR_WIDTH, Mesh, evenly, mix, place, turned


def vault():
    """The vault over a bay of the nave, with its wall ribs."""
    mesh = Mesh()
    ribbed_vault(mesh, 0.0, NAVE_WALL, DIAGONAL, TRANSVERSE, WALL_RIB, WALL_RIB_HEIGHTS, RIB, 9)
    half = [(0.02, -0.14), (-0.09, -0.14), (-0.15, -0.06), (-0.17, 0.02)]
    for side in (1.0, -1.0):
        rows = place(WALL_RIB.rows(half, evenly(8)), (0.0, side * NAVE_WALL), (side, 0.0))
        mesh.grid("limestone", rows, toward=(0.0, 15.0, 0.0))
    boss(mesh, (0.0, VAULT_TOP, 0.0), 0.36)
    return mesh


def transverse_rib():
    """The arch across the nave between two bays."""
    mesh = Mesh()
    broad = [(u * 1.15, w * 1.4) for u, w in RIB]
    rows = place(TRANSVERSE.rows(broad, evenly(11)), (0.0, 0.0), (0.0, 1.0))
    mesh.grid("limestone", rows, toward=(0.0, 0.0, 0.0))
    return mesh


def ribbed_vault(
    mesh, axis, half_width, diagonal, transverse, wall_rib, heights, section, rib_steps
):
    """Four cells on a rectangle, ruled between ribs of equal height, and two diagonals."""
    reach = dist((0, 0), (HALF_BAY, half_width))
    for east in (-1.0, 1.0):
        for south in (-1.0, 1.0):
            along, edge, cross_edge = [], [], []
            for y in heights:
                t = diagonal.x_at(y) / reach
                along.append((east * HALF_BAY * t, y, axis + south * half_width * t))
                edge.append((east * wall_rib.x_at(y), y, axis + south * half_width))
                cross_edge.append((east * HALF_BAY, y, axis + south * transverse.x_at(y)))
            web(mesh, along, edge)
            web(mesh, along, cross_edge)
    for south in (-1.0, 1.0):
        rows = diagonal.rows(section, evenly(rib_steps))
        direction = (HALF_BAY / reach, south * half_width / reach)
        mesh.grid("limestone", place(rows, (0.0, axis), direction), toward=(0.0, 0.0, axis))


def web(mesh, rib, edge, bulge=0.05):
    """A cell of a vault between two curves from the springing to the ridge."""
    across = 3
    rows, coordinates, course = [], [], 0.0
    for i, (a, b) in enumerate(zip(rib, edge)):
        if i:
            course += dist(mix(rib[i - 1], edge[i - 1], 0.5), mix(a, b, 0.5))
        span = dist(a, b)
        row = []
        for k in range(across + 1):
            t = k / across
            x, y, z = mix(a, b, t)
            row.append((x, y + bulge * span * 4 * t * (1 - t), z))
        rows.append(row)
        coordinates.append(
            [(span * k / across / ASHLAR_WIDTH, course / ASHLAR_HEIGHT) for k in range(across + 1)]
        )
    mesh.grid("ashlar_vault", rows, uv=coordinates, toward=(0.0, 0.0, rib[-1][2]))


def boss(mesh, centre, radius):
    """The keystone where ribs meet."""
    x, y, z = centre
    profile = [
        (radius, y),
        (radius, y - 0.22),
        (radius * 0.7, y - 0.3),
        (radius * 0.4, y - 0.3),
        (0.0, y - 0.4),
    ]
    mesh.grid("gilding", turned((x, z), profile, 8), away=(x, y, z))
