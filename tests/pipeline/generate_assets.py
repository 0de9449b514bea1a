"""Writes GLB files of 1 kB to 10 MB, most of them small, each of one to six wavy grids; the same ones for the same seed.

generate_assets.py COUNT SEED FOLDER
"""

import json
import math
import random
import struct
import sys
from array import array
from pathlib import Path

LEAST, MOST = 1e3, 1e7
# Of the Pareto distribution of sizes.
EXPONENT = 0.6
# Bytes of a scene without geometry, and per vertex with its six indices of two or four bytes.
WITHOUT_GEOMETRY, PER_VERTEX, PER_VERTEX_WIDE = 800, 24, 36
WIDE = 1 << 16


def size(rng):
    least, most = LEAST**-EXPONENT, MOST**-EXPONENT
    return (least - rng.random() * (least - most)) ** (-1 / EXPONENT)


def grid(rng, side, offset):
    height, phase = rng.uniform(0.5, 2), rng.random() * 6
    positions = array("f")
    for y in range(side):
        for x in range(side):
            z = height * math.sin(phase + x * 6 / side) * math.cos(y * 5 / side)
            positions.extend((x / side + offset * 0.3, z, y / side + offset * 0.2))
    indices = array("I" if side * side > WIDE else "H")
    for y in range(side - 1):
        for x in range(side - 1):
            a = y * side + x
            indices.extend((a, a + side, a + 1, a + 1, a + side, a + side + 1))
    return positions, indices


def scene(rng):
    wanted, objects = size(rng), rng.randint(1, 6)
    per_vertex = PER_VERTEX_WIDE if wanted > 1.5e6 else PER_VERTEX
    side = max(2, int(math.sqrt(max(wanted - WITHOUT_GEOMETRY, 300) / objects / per_vertex)))
    data, views, accessors = b"", [], []
    for number in range(objects):
        positions, indices = grid(rng, side, number)
        bounds = {"min": [min(positions[k::3]) for k in range(3)], "max": [max(positions[k::3]) for k in range(3)]}
        component = 5125 if indices.typecode == "I" else 5123
        for values, described in (
            (positions, {"componentType": 5126, "count": side * side, "type": "VEC3", **bounds}),
            (indices, {"componentType": component, "count": len(indices), "type": "SCALAR"}),
        ):
            raw = values.tobytes()
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
            accessors.append({"bufferView": len(views) - 1, **described})
            data += raw + b"\0" * (-len(raw) % 4)
    meshes = [{"primitives": [{"attributes": {"POSITION": 2 * o}, "indices": 2 * o + 1}]} for o in range(objects)]
    nodes = [{"name": f"part{o}", "mesh": o} for o in range(objects)]
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(objects))}], "nodes": nodes, "meshes": meshes,
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def main():
    count, seed, folder = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
    for number in range(count):
        file = folder / f"{number % 100:02}" / f"{number}.glb"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(scene(random.Random(seed * 1000003 + number)))


main()
