"""The measures of the nave, its arches, and the sections of its mouldings.

X runs east along the nave, Z across it; modules are made for the south side (+Z) about
their own origin and turned round for the north side. All lengths are metres.
"""

from math import cos, dist, pi, sin

from shapes import Arch, mirrored

# Plan.
BAY = 5.5  # from pier to pier
HALF_BAY = BAY / 2
NAVE_WALL = 4.7  # from the axis of the nave to the face of its walls
PIERS = 5.25  # ... to the axis of the piers
AISLE_FACE = 5.8  # ... to the aisle's side of the arcade
OUTER_WALL = 10.0  # ... to the outer wall of the aisle
FOUNDATION = 10.35  # floors and end walls go on under and behind the walls

# Heights.
ARCADE_SPRING = 5.5
TRIFORIUM = 9.1
CLERESTORY = 12.5
VAULT_SPRING = 13.0
VAULT_RISE = 6.6
VAULT_TOP = VAULT_SPRING + VAULT_RISE
AISLE_RISE = 3.5
AISLE_TOP = ARCADE_SPRING + AISLE_RISE
WINDOW_SILL = 13.2  # at the face of the wall; it slopes up to the glass
WINDOW_DEPTH = 0.6  # of the clerestory's jambs, from the face of the wall
TRACERY_DEPTH = 0.5  # of the middle of the tracery; it stands half out of the panes
PANE_DEPTH = 0.53  # of the clerestory's panes
GLASS_SILL = 13.55  # where the sloping sill meets the panes

DIAGONAL = Arch(dist((0, 0), (HALF_BAY, NAVE_WALL)), VAULT_SPRING, VAULT_RISE)
TRANSVERSE = Arch(NAVE_WALL, VAULT_SPRING, VAULT_RISE)
WALL_RIB = Arch(HALF_BAY, VAULT_SPRING, VAULT_RISE - 2.4, stilt=2.4)
AISLE_HALF = (OUTER_WALL - AISLE_FACE) / 2
AISLE_AXIS = (OUTER_WALL + AISLE_FACE) / 2
AISLE_DIAGONAL = Arch(dist((0, 0), (HALF_BAY, AISLE_HALF)), ARCADE_SPRING, AISLE_RISE)
AISLE_TRANSVERSE = Arch(AISLE_HALF, ARCADE_SPRING, AISLE_RISE - 0.8, stilt=0.8)
AISLE_WALL_RIB = Arch(HALF_BAY, ARCADE_SPRING, AISLE_RISE - 0.3, stilt=0.3)
WINDOW = Arch(1.5, VAULT_SPRING, 2.35, stilt=3.2)

# Where webs and walls meet they share the heights of the vault's courses.
WALL_RIB_HEIGHTS = DIAGONAL.heights(11)
AISLE_HEIGHTS = AISLE_DIAGONAL.heights(7)

# The apse: five sides of a decagon about the end of the nave's axis.
APSE_TURN = pi / 10  # half the angle of a side
APSE_WALL = NAVE_WALL * cos(APSE_TURN)
APSE_HALF = NAVE_WALL * sin(APSE_TURN)
APSE_RIB = Arch(APSE_HALF, VAULT_SPRING, 3.0, stilt=2.9)
APSE_SILL = 4.3
APSE_WINDOW = Arch(0.85, APSE_SILL - 0.3, 1.55, stilt=11.0)
APSE_GLASS_DEPTH = 0.5

# Sections of mouldings.
RIB = mirrored(
    [(0.04, -0.14), (-0.1, -0.14), (-0.13, -0.08), (-0.2, -0.085), (-0.26, -0.06), (-0.29, 0.0)]
)
SLIM_RIB = mirrored([(0.04, -0.11), (-0.08, -0.11), (-0.13, -0.07), (-0.2, 0.0)])
STRING = [(0.0, -0.1), (0.05, -0.1), (0.1, -0.02), (0.12, 0.06), (0.1, 0.1), (0.0, 0.16)]
TRACERY = [
    (0.02, -0.09),
    (0.06, -0.01),
    (0.06, 0.07),
    (-0.06, 0.07),
    (-0.06, -0.01),
    (-0.02, -0.09),
]
FINE_TRACERY = [(0.0, -0.05), (0.035, 0.0), (0.0, 0.05), (-0.035, 0.0)]

SHAFT_BASE = [(0.1, 0.0), (0.12, 0.05), (0.09, 0.11), (0.04, 0.14), (0.065, 0.19), (0.0, 0.25)]


def capital(foot, top):
    """The profile of a capital: necking, bell, abacus."""
    bell = top - 0.2
    return [
        (0.0, foot),
        (0.035, foot + 0.03),
        (0.0, foot + 0.08),
        (0.06, bell - 0.07),
        (0.12, bell),
        (0.17, bell + 0.04),
        (0.14, bell + 0.1),
        (0.14, top),
    ]
