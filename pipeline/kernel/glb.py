"""Binary glTF of a part for looking at it anywhere: metres, Y up, normals of the exact surface."""

import json
import struct

import numpy as np

from cuspline.values import fixed_math as fixed

MAGIC, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942


def write_glb(path, name, vertices_mm, normals, triangles):
    """One mesh, one material.

    Args:
        path: file to write.
        name: of the part.
        vertices_mm, normals: (n, 3).
        triangles: (m, 3).
    """
    # glTF is Y up: (x, y, z) -> (x, z, -y)
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    points = (fixed.matmul(np.asarray(vertices_mm), turn.T) / 1000.0).astype("<f4")
    directions = (fixed.matmul(np.asarray(normals), turn.T)).astype("<f4")
    indices = np.asarray(triangles).astype("<u4")
    blobs = [points.tobytes(), directions.tobytes(), indices.tobytes()]
    offsets = np.cumsum([0] + [len(b) for b in blobs])
    views = [{"buffer": 0, "byteOffset": int(o), "byteLength": len(b), "target": t}
             for o, b, t in zip(offsets, blobs, (34962, 34962, 34963))]
    document = {
        "asset": {"version": "2.0", "generator": "cuspline"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2,
                                                  "material": 0}]}],
        "materials": [{"name": "metal", "pbrMetallicRoughness": {
            "baseColorFactor": [0.7, 0.74, 0.8, 1.0], "metallicFactor": 0.4, "roughnessFactor": 0.45}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
             "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()},
            {"bufferView": 1, "componentType": 5126, "count": len(directions), "type": "VEC3"},
            {"bufferView": 2, "componentType": 5125, "count": int(indices.size), "type": "SCALAR"}],
        "bufferViews": views, "buffers": [{"byteLength": int(offsets[-1])}]}
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(blobs)
    with open(path, "wb") as file:
        file.write(struct.pack("<III", MAGIC, 2, 12 + 8 + len(text) + 8 + len(binary)))
        file.write(struct.pack("<II", len(text), JSON_CHUNK) + text)
        file.write(struct.pack("<II", len(binary), BINARY_CHUNK) + binary)
