#!/usr/bin/env python3
"""Makes everything in this folder: a mesh, a sky, and Mitsuba 3's pictures of two scenes that skylit describes too.

    pip install mitsuba numpy && python3 tests/reference/make.py

The pictures are stored as means with the standard error of each pixel, from independent runs.
"""
import os

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
HERE = os.path.dirname(os.path.abspath(__file__))
T = mi.ScalarTransform4f


def sky(u, v):
    """Radiance at u = 0.5 + atan2(z, x) / 2 pi, v = 0.5 + asin(y) / pi: a smooth dome with one bright blob."""
    phi, theta = (u - 0.5) * 2 * np.pi, (v - 0.5) * np.pi
    d = np.stack([np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)], -1)
    sun = np.array([0.5, 0.6, 0.3]) / np.linalg.norm([0.5, 0.6, 0.3])
    blob = np.exp(-((1 - d @ sun) / 0.02))[..., None]
    up = d[..., 1:2]
    dome = 0.4 + 0.3 * up * np.array([0.5, 0.8, 1.2]) + 0.05 * d[..., 0:1] * np.array([1.0, 0.2, -0.5])
    return (np.maximum(dome, 0.01) + blob * np.array([9.0, 8.0, 6.0])).astype(np.float32)


def grid(w, h, centred):
    """Where the texels are: at centres for skylit, at u = i / w and v = 1 - j / (h - 1) for Mitsuba's envmap."""
    i, j = np.arange(w), np.arange(h)
    u = (i + 0.5) / w if centred else i / w
    v = 1 - ((j + 0.5) / h if centred else j / (h - 1))
    return np.meshgrid(u, v)


def mitsuba_sky():
    u, v = grid(512, 256, False)
    # Mitsuba's u is ours less a quarter.
    return mi.Bitmap(sky((u + 0.25) % 1.0, v))


def write_knot(path, around=120, across=12):
    """A trefoil tube as plain triangles without normals."""
    with open(path, "w") as f:
        f.write("# a trefoil tube; made by make.py\n")
        t = np.linspace(0, 2 * np.pi, around, endpoint=False)
        c = lambda t: np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], -1) * 0.45
        p = c(t)
        d = c(t + 1e-4) - c(t - 1e-4)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        n = np.cross(d, [0.13, 0.31, 0.94])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        b = np.cross(d, n)
        for i in range(around):
            for k in range(across):
                a = 2 * np.pi * k / across
                x, y, z = p[i] + 0.22 * (np.cos(a) * n[i] + np.sin(a) * b[i])
                f.write(f"v {x:.6f} {y:.6f} {z:.6f}\n")
        at = lambda i, k: 1 + (i % around) * across + k % across
        for i in range(around):
            for k in range(across):
                q = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]
                f.write(f"f {q[0]} {q[1]} {q[2]}\nf {q[0]} {q[2]} {q[3]}\n")


def diffuse(r, g, b):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [r, g, b]}}}


def floor():
    # Mitsuba's rectangle spans -1..1 in x and y and faces +z.
    to_world = T().translate([0, -1.4, 0]) @ T().rotate([1, 0, 0], -90) @ T().scale(4)
    return {"type": "rectangle", "to_world": to_world, "bsdf": diffuse(0.5, 0.5, 0.6)}


def sensor():
    return {
        "type": "perspective",
        "fov": 40,
        "fov_axis": "y",
        "to_world": T().look_at(origin=[3, 2, 5], target=[0, -0.1, 0], up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 64, "height": 48, "rfilter": {"type": "box"}, "component_format": "float32"},
        "sampler": {"type": "independent"},
    }


def scene(name):
    knot = {"type": "obj", "filename": os.path.join(HERE, "knot.obj"), "face_normals": True}
    base = {
        "type": "scene",
        # Six surfaces are seven edges.
        "integrator": {"type": "path", "max_depth": 7, "rr_depth": 100},
        "sensor": sensor(),
        "floor": floor(),
    }
    if name == "clay":
        return base | {
            "knot": knot | {"bsdf": diffuse(0.8, 0.6, 0.4)},
            "sky": {"type": "envmap", "bitmap": mitsuba_sky()},
        }
    lamp = {"type": "area", "radiance": {"type": "rgb", "value": [20, 16, 10]}}
    return base | {
        "knot": knot | {"bsdf": diffuse(0.3, 0.5, 0.8)},
        "ball": {"type": "sphere", "center": [1.6, -0.7, 1.2], "radius": 0.7, "bsdf": {"type": "conductor"}},
        "lamp": {"type": "sphere", "center": [-1.5, 2.2, 1.5], "radius": 0.4, "emitter": lamp},
        "bulb": {"type": "point", "position": [2.5, 1.5, -1.0], "intensity": {"type": "rgb", "value": [2, 3, 6]}},
    }


def main():
    write_knot(os.path.join(HERE, "knot.obj"))
    u, v = grid(512, 256, True)
    mi.Bitmap(sky(u, v)).convert(component_format=mi.Struct.Type.Float16).write(os.path.join(HERE, "sky.exr"))
    for name in ["clay", "lamps"]:
        built = mi.load_dict(scene(name))
        runs = 64
        images = [np.array(mi.render(built, spp=256, seed=i))[..., :3] for i in range(runs)]
        mean = np.mean(images, 0)
        error = np.std(images, 0, ddof=1) / np.sqrt(runs)
        both = np.concatenate([mean, error], 0).astype(np.float32)
        # Means on top, standard errors below: one plain RGB picture of twice the height.
        mi.Bitmap(both).write(os.path.join(HERE, f"{name}.exr"))
        print(name, mean.mean((0, 1)), error.mean((0, 1)))


if __name__ == "__main__":
    main()
