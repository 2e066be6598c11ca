"""Meshes and float pictures, as all peers are given them."""
import os

import numpy as np


def read_ply(data):
    """Positions and triangles of an ascii PLY with x y z alone, as the Stanford repository has them (bytes)."""
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().split("\n")
    if "format ascii 1.0" not in lines:
        raise ValueError("a PLY that is not ascii")
    counts = {words[1]: int(words[2]) for words in map(str.split, lines) if words[:1] == ["element"]}
    if sum(line.startswith("property") for line in lines) != 4:
        raise ValueError("a PLY with more than x, y, z and lists of vertices")
    numbers = np.array(body.split(), dtype=np.float64)
    split = 3 * counts["vertex"]
    faces = numbers[split:].reshape(counts["face"], 4)
    if not np.all(faces[:, 0] == 3):
        raise ValueError("a PLY with faces that are no triangles")
    return numbers[:split].reshape(-1, 3), faces[:, 1:].astype(np.int32)


def write_ply(path, positions, triangles):
    """As binary PLY, which every peer and skylit load."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, triangles
    with open(path, "wb") as f:
        f.write(header.encode() + np.asarray(positions, "<f4").tobytes() + faces.tobytes())


def load_ply(path):
    """Positions and triangles of a binary PLY that `write_ply` or skylit's mesh_to_ply wrote."""
    with open(path, "rb") as f:
        head, body = f.read().split(b"end_header\n", 1)
    lines = head.decode().split("\n")
    properties = [line.split()[1:] for line in lines if line.startswith("property")]
    names = [p[-1] for p in properties]
    if "format binary_little_endian 1.0" not in lines or names[:3] != ["x", "y", "z"] or len(names) != 4:
        raise ValueError(f"{path}: not of the form that is expected here")
    counts = [int(line.split()[2]) for line in lines if line.startswith("element")]
    index = {"int": "<i4", "uint": "<u4", "int32": "<i4", "uint32": "<u4"}[properties[3][2]]
    positions = np.frombuffer(body, "<f4", 3 * counts[0]).reshape(-1, 3)
    faces = np.frombuffer(body, np.dtype([("n", "u1"), ("v", index, 3)]), counts[1], 12 * counts[0])
    if not np.all(faces["n"] == 3):
        raise ValueError(f"{path}: has faces that are no triangles")
    return positions, faces["v"].astype(np.int32)


def write_exr(path, planes, header=None):
    """`planes`: name to array of one channel. Written beside and moved, so that no half of a file is ever found."""
    import OpenEXR

    kind = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: np.ascontiguousarray(p, np.float32) for name, p in planes.items()}
    OpenEXR.File({**kind, **(header or {})}, planes).write(path + ".part.exr")
    os.replace(path + ".part.exr", path)


def read_exr(path):
    """Channels by name, and the header."""
    import OpenEXR

    with OpenEXR.File(path, separate_channels=True) as f:
        return {name: np.array(c.pixels) for name, c in f.channels().items()}, dict(f.header())


def rgb(planes):
    return np.stack([planes[c] for c in "RGB"], -1)
