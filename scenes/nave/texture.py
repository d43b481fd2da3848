"""The texture of the walls: courses of ashlar in four tints of limestone, as a PNG.

It repeats in both directions: four blocks by six courses. The PNG has a palette and is
not compressed, since compressors differ from version to version and the bytes may not.
"""

import struct
import zlib

from dice import Dice

SIZE = 256
COURSES = 6
BLOCKS = 4
SHADES = 16
JOINT = 1.1  # pixels

# Reflectance of the stones in linear RGB.
TINTS = [(0.78, 0.73, 0.65), (0.75, 0.70, 0.61), (0.79, 0.75, 0.69), (0.73, 0.69, 0.63)]


def ashlar():
    """The bytes of the PNG file."""
    return png(SIZE, palette(), pixels())


def palette():
    """SHADES of each tint, dark to light, as sRGB bytes."""
    entries = []
    for tint in TINTS:
        for shade in range(SHADES):
            factor = 0.62 + 0.44 * shade / (SHADES - 1)
            entries.append(bytes(encode(value * factor) for value in tint))
    return entries


def encode(linear):
    """Linear reflectance as an sRGB byte."""
    value = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
    return round(255 * value)


def pixels():
    """Palette indices, row by row from the top."""
    dice = Dice(11)
    joints, stones = [], []
    for course in range(COURSES):
        shift = (course % 2) * SIZE / (2 * BLOCKS)
        edges = [shift + SIZE * k / BLOCKS + dice.throw(17) - 8 for k in range(BLOCKS)]
        joints.append(edges)
        stones.append([(dice.throw(len(TINTS)), 9 + dice.throw(5)) for _ in range(BLOCKS)])
    height = SIZE / COURSES
    rows = []
    for y in range(SIZE):
        course = int(y / height)
        from_bed = min(y - course * height, (course + 1) * height - y)
        row = bytearray()
        for x in range(SIZE):
            edges = joints[course]
            right = [(x - edge) % SIZE for edge in edges]
            block = right.index(min(right))
            from_joint = min(min(right), min(SIZE - r for r in right))
            tint, shade = stones[course][block]
            shade += dice.throw(3) - 1
            if min(from_bed, from_joint) < JOINT:
                shade = dice.throw(4) + 1
            row.append(tint * SHADES + shade)
        rows.append(bytes(row))
    return rows


def png(size, colours, rows):
    """A square PNG with a palette, in stored (uncompressed) blocks."""
    data = b"".join(b"\0" + row for row in rows)
    blocks = [data[i : i + 65535] for i in range(0, len(data), 65535)]
    stream = b"\x78\x01"
    for i, block in enumerate(blocks):
        last = i == len(blocks) - 1
        stream += struct.pack("<BHH", last, len(block), len(block) ^ 0xFFFF) + block
    stream += struct.pack(">I", zlib.adler32(data))
    header = struct.pack(">IIBBBBB", size, size, 8, 3, 0, 0, 0)
    parts = ((b"IHDR", header), (b"PLTE", b"".join(colours)), (b"IDAT", stream), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(name, body) for name, body in parts)


def chunk(name, body):
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
