"""Shapes of cut stone: a mesh that smooths itself, pointed arches, sweeps, turned shafts.

Coordinates are metres, Y up. A "section" is a list of (u, w): u leads away from the
axis of what is swept (for an arch: away from its centre), w leads across.
"""

from math import acos, atan2, cos, dist, hypot, pi, radians, sin, sqrt

# Faces that meet at a sharper angle keep their edge; others share a normal.
CREASE_DEGREES = 42.0

# One repetition of the ashlar texture: four blocks by six courses.
ASHLAR_WIDTH = 2.75
ASHLAR_HEIGHT = 2.4


def subtract(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def unit(a):
    length = sqrt(dot(a, a))
    return (a[0] / length, a[1] / length, a[2] / length)


def mix(a, b, t):
    return tuple(p + (q - p) * t for p, q in zip(a, b))


def number(value, decimals):
    """A number as text; the first rounding makes ties the same on every machine."""
    text = f"{round(round(value, 9), decimals):.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


class Mesh:
    """Triangles by material. Normals are shared inside a part, never between parts."""

    def __init__(self):
        self.triangles = []  # (material, part, corners, texture coordinates or None)
        self.part = 0

    def grid(self, material, rows, *, closed=False, toward=None, away=None, uv=None):
        """Fills the space between neighbouring rows of points as one part.

        `closed` joins the last column to the first. The part is turned so that on the
        whole it faces `toward` a point, or `away` from it. `uv` has a texture
        coordinate for each point.
        """
        self.part += 1
        columns = len(rows[0])
        quads = []
        for i in range(len(rows) - 1):
            for j in range(columns if closed else columns - 1):
                k = (j + 1) % columns
                at = ((i, j), (i, k), (i + 1, k), (i + 1, j))
                corners = [rows[a][b] for a, b in at]
                quads.append((corners, [uv[a][b] for a, b in at] if uv else None))
        if self._looks_away(quads, toward, away):
            quads = [(c[::-1], t[::-1] if t else None) for c, t in quads]
        for corners, coordinates in quads:
            self._quad(material, corners, coordinates)

    def polygon(self, material, corners, *, toward=None, away=None):
        """A flat convex polygon, as a fan."""
        self.part += 1
        if self._looks_away([(corners[:3] + corners[2:3], None)], toward, away):
            corners = corners[::-1]
        for b, c in zip(corners[1:], corners[2:]):
            self._triangle(material, (corners[0], b, c), None)

    def box(self, material, low, high):
        """A box with sharp edges, facing outwards."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        middle = ((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2)
        bottom = [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)]
        top = [(x, y1, z) for x, _, z in bottom]
        self.grid(material, [bottom, top], closed=True, away=middle)
        self.polygon(material, bottom, away=middle)
        self.polygon(material, top, away=middle)

    @staticmethod
    def _looks_away(quads, toward, away):
        if toward is None and away is None:
            return False
        target = toward or away
        facing = 0.0
        for (a, b, c, d), _ in quads:
            middle = mix(mix(a, c, 0.5), mix(b, d, 0.5), 0.5)
            normal = cross(subtract(c, a), subtract(d, b))
            facing += dot(normal, subtract(target, middle))
        return facing < 0 if toward else facing > 0

    def _quad(self, material, corners, uv):
        # The shorter diagonal gives the rounder triangles.
        first, second = (0, 1, 2), (0, 2, 3)
        if dist(corners[0], corners[2]) > dist(corners[1], corners[3]) + 1e-6:
            first, second = (0, 1, 3), (1, 2, 3)
        for pick in (first, second):
            self._triangle(
                material,
                tuple(corners[i] for i in pick),
                tuple(uv[i] for i in pick) if uv else None,
            )

    def _triangle(self, material, corners, uv):
        a, b, c = (tuple(round(x, 4) for x in corner) for corner in corners)
        area = cross(subtract(b, a), subtract(c, a))
        if dot(area, area) < 1e-11:
            return  # folded to a line, as at the tip of a web
        if uv is None and material.startswith("ashlar"):
            uv = tuple(planar_uv(p, area) for p in corners)
        self.triangles.append((material, self.part, corners, uv))

    def obj(self, title, materials="nave.mtl"):
        """The mesh as the text of an OBJ file."""
        normals = self._normals()
        positions, coordinates, directions = Numbering("v"), Numbering("vt"), Numbering("vn")
        groups = {}
        for (material, _, corners, uv), normal in zip(self.triangles, normals):
            face = []
            for k in range(3):
                v = positions.index(corners[k], 4)
                vt = coordinates.index(uv[k], 4) if uv else ""
                face.append(f"{v}/{vt}/{directions.index(normal[k], 3)}")
            groups.setdefault(material, []).append("f " + " ".join(face))
        lines = [f"# {title} Written by generate.py.", f"mtllib {materials}"]
        lines += positions.lines + coordinates.lines + directions.lines
        for material, faces in groups.items():
            lines += [f"usemtl {material}"] + faces
        return "\n".join(lines) + "\n"

    def _normals(self):
        """A normal for each corner: the mean of the faces of its part that meet there."""
        weighted = []
        meeting = {}
        for index, (_, part, corners, _) in enumerate(self.triangles):
            a, b, c = corners
            weighted.append(cross(subtract(b, a), subtract(c, a)))
            for corner in corners:
                meeting.setdefault(self._corner(part, corner), []).append(index)
        flat = [unit(n) for n in weighted]
        limit = cos(radians(CREASE_DEGREES))
        result = []
        for index, (_, part, corners, _) in enumerate(self.triangles):
            smooth = []
            for corner in corners:
                around = meeting[self._corner(part, corner)]
                near = [weighted[i] for i in around if dot(flat[i], flat[index]) > limit]
                smooth.append(unit(tuple(map(sum, zip(*near)))))
            result.append(smooth)
        return result

    @staticmethod
    def _corner(part, corner):
        return (part, *(round(x, 4) for x in corner))


class Numbering:
    """Numbers the different lines of one kind in an OBJ file, from 1."""

    def __init__(self, keyword):
        self.keyword = keyword
        self.lines = []
        self.known = {}

    def index(self, values, decimals):
        line = f"{self.keyword} " + " ".join(number(v, decimals) for v in values)
        if line not in self.known:
            self.lines.append(line)
            self.known[line] = len(self.lines)
        return self.known[line]


def planar_uv(point, normal):
    """Texture coordinates of a wall: courses level, blocks along the wall."""
    along = point[0] if abs(normal[2]) >= abs(normal[0]) else point[2]
    return (along / ASHLAR_WIDTH, point[1] / ASHLAR_HEIGHT)


class Arch:
    """A pointed arch of two arcs over straight jambs.

    `spring` is the height where it starts, `stilt` the length of the straight part,
    `rise` the height of the arcs. `at` and `x_at` speak of its right half.
    """

    def __init__(self, half_span, spring, rise, stilt=0.0):
        self.half_span = half_span
        self.spring = spring
        self.base = spring + stilt
        self.radius = (rise * rise + half_span * half_span) / (2 * half_span)
        self.centre = half_span - self.radius
        self.apex = self.base + rise

    def at(self, fraction, u=0.0):
        """A point of the arc offset by `u`: fraction 0 at its foot, 1 at the apex."""
        radius = self.radius + u
        angle = fraction * acos(-self.centre / radius)
        return (self.centre + radius * cos(angle), self.base + radius * sin(angle))

    def x_at(self, height):
        """Half the width of the arch at a height."""
        if height <= self.base:
            return self.half_span
        rest = self.radius**2 - min(height - self.base, self.apex - self.base) ** 2
        return max(self.centre + sqrt(max(rest, 0.0)), 0.0)

    def heights(self, steps):
        """Heights of evenly spaced points of the arc, the springing first."""
        return [self.at(i / steps)[1] for i in range(steps + 1)]

    def rows(self, section, fractions):
        """The section swept from the right foot over the apex to the left foot.

        Gives rows of (a, y, w) with a measured from the axis of the arch.
        """
        right = [[(*self.at(f, u), w) for u, w in section] for f in fractions]
        if self.base > self.spring:
            right.insert(0, [(self.half_span + u, self.spring, w) for u, w in section])
        left = [[(-a, y, w) for a, y, w in row] for row in right[-2::-1]]
        return right + left


def evenly(steps):
    """Fractions from 0 to 1."""
    return [i / steps for i in range(steps + 1)]


def place(rows, origin, direction):
    """Rows of (a, y, w) stood up in space: a runs along `direction`, both (x, z)."""
    (ox, oz), (dx, dz) = origin, direction
    return [[(ox + dx * a - dz * w, y, oz + dz * a + dx * w) for a, y, w in row] for row in rows]


def mirrored(section):
    """A section completed by its mirror image about w = 0."""
    return section + [(u, -w) for u, w in reversed(section) if w != 0]


def roll(centre, radius, first, last, steps):
    """Part of a round moulding in a section: angles in degrees, 0 along u, 90 along w."""
    angles = [radians(first + (last - first) * i / steps) for i in range(steps + 1)]
    return [(centre[0] + radius * cos(a), centre[1] + radius * sin(a)) for a in angles]


def bar(path, section, depth):
    """A bar of tracery along a path of (x, y); its section lies at the given depth (z)."""
    rows = []
    loop = dist(path[0], path[-1]) < 1e-9
    for i, (x, y) in enumerate(path):
        before = path[i - 1] if i > 0 else (path[-2] if loop else path[0])
        after = path[i + 1] if i + 1 < len(path) else (path[1] if loop else path[-1])
        tx, ty = after[0] - before[0], after[1] - before[1]
        length = hypot(tx, ty)
        nx, ny = -ty / length, tx / length
        rows.append([(x + nx * u, y + ny * u, depth + w) for u, w in section])
    return rows


def arc(centre, radius, first, last, steps):
    """Points of a circle in the (x, y) plane, angles in degrees."""
    return roll(centre, radius, first, last, steps)


def turned(axis, profile, sides, first=0.0, last=360.0):
    """Rows of a turned shaft: a profile of (radius, y) about an upright axis (x, z)."""
    angles = [radians(first + (last - first) * i / sides) for i in range(sides + 1)]
    return [[(axis[0] + r * cos(a), y, axis[1] + r * sin(a)) for a in angles] for r, y in profile]


def cluster(discs, profile, ends=None):
    """Rows of a clustered shaft: discs (x, z, radius, sides) that overlap, in order round.

    The profile is (offset, y): moulding a cluster offsets every disc of it. A cluster
    is closed unless `ends` gives its first and last angle in degrees.
    """
    return [[(x, y, z) for x, z in _outline(discs, offset, ends)] for offset, y in profile]


def _outline(discs, offset, ends):
    points = []
    count = len(discs)
    for k, (x, z, radius, sides) in enumerate(discs):
        radius += offset
        first = last = None
        if ends and k == 0:
            first = radians(ends[0])
        if ends and k == count - 1:
            last = radians(ends[1])
        if first is None:
            px, pz = _crease(discs[k - 1], discs[k], offset)
            first = atan2(pz - z, px - x)
        if last is None:
            px, pz = _crease(discs[k], discs[(k + 1) % count], offset)
            last = atan2(pz - z, px - x)
        while last <= first:
            last += 2 * pi
        while last > first + 2 * pi:
            last -= 2 * pi
        for i in range(sides + 1 if k == count - 1 else sides):
            angle = first + (last - first) * i / sides
            points.append((x + radius * cos(angle), z + radius * sin(angle)))
    return points


def _crease(one, other, offset):
    """Where two neighbouring discs meet, going round anticlockwise: on the outside."""
    (x0, z0, r0, _), (x1, z1, r1, _) = one, other
    r0, r1 = r0 + offset, r1 + offset
    dx, dz = x1 - x0, z1 - z0
    gap = hypot(dx, dz)
    along = (r0 * r0 - r1 * r1 + gap * gap) / (2 * gap)
    aside = sqrt(r0 * r0 - along * along)
    # Outside is to the right of the way from one disc to the next.
    return (x0 + (dx * along + dz * aside) / gap, z0 + (dz * along - dx * aside) / gap)
