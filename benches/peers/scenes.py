#!/usr/bin/env python3
"""Writes the scenes that skylit and its peers are compared on: NAME.toml for skylit, NAME.json for the others.

    python3 benches/peers/scenes.py DIR [--only NAME,...] [--skylit PROGRAM] [--exporter COMMAND] [--data FOLDER]

Needs numpy and OpenEXR. Scenes of shared data are left out, with a line that says so, where the data is absent. What
stands in DIR already is kept: delete a file to have it made again.
"""
import argparse
import json
import os
import shlex
import subprocess
import sys

import numpy as np

from files import read_ply, write_exr, write_ply

SIZE = [480, 270]
# Equirectangular width of the skies that peers are given: half of a cube's 2048-texel faces, and six texels across the
# sun of the preset skies.
SKY_WIDTH = 4096
HOME = os.path.dirname(os.path.abspath(__file__))


class Absent(Exception):
    """Data or a program that a scene needs."""


# What is in the scenes. Every object has a mesh and, if it stands elsewhere than in world space or more than once,
# `placements` (4 x 4, row by row); `toml` says it to skylit where that makes the shape itself.

DRAGON_CAMERA = {"eye": [5, 0, 0], "look_at": [0, 0, 0], "up": [0, 1, 0], "fov_deg": 60}
KNOT_CAMERA = {"eye": [0, 0.9, 6.5], "look_at": [0, 0, 0], "up": [0, 1, 0], "fov_deg": 42}
BALLS_CAMERA = {"eye": [3, 2.2, 6], "look_at": [0, 0.5, 0], "up": [0, 1, 0], "fov_deg": 36}
HERD_CAMERA = {"eye": [42, 20, 10], "look_at": [-10, -6, 0], "up": [0, 1, 0], "fov_deg": 50}
BALLS = [(0, 1, 0, 1), (1.9, 0.5, 1.2, 0.5), (-2, 0.7, 0.5, 0.7), (0.6, 0.3, 1.9, 0.3), (-0.8, 0.35, 1.7, 0.35)]

CLAY = {"type": "diffuse", "albedo": 0.8}
FLOOR = {"type": "diffuse", "albedo": 0.5}
# White, so that Fresnel's reflectance is 1 in every model, and one reflection alone, as most peers have it. skylit's `metal`
# gives back what bounces between facets as well, which makes metal-sun 1.8 % brighter; its `ggx` without a base does not.
METAL = {
    "type": "metal",
    "color": 1.0,
    "roughness": 0.3,
    "toml": {"type": "ggx", "diffuse": 0.0, "specular": 1.0, "alpha": 0.09},
}

DRAGON = {"mesh": "dragon.ply", "material": "body"}
GROUND = {"mesh": "ground.ply", "material": "floor"}
# The knot of benches/floor as a file for skylit, too: its own shape has smooth normals, which the file lacks.
KNOT = {"mesh": "knot.ply", "material": "body"}


def ball(x, y, z, r):
    return {
        "mesh": "ball.ply",  # for those who have no spheres
        "material": "body",
        "placements": [[r, 0, 0, x, 0, r, 0, y, 0, 0, r, z, 0, 0, 0, 1]],
        "sphere": {"center": [x, y, z], "radius": r},
        "toml": f'shape = {{ type = "sphere", center = [{x}, {y}, {z}], radius = {r} }}',
    }


def herd():
    """One dragon at the origin and a thousand around it, on a grid that is not quite regular, each turned at will."""
    random = np.random.default_rng(1)
    out = [np.eye(4)]
    places = [(i - 15.5, j - 15.5) for i in range(32) for j in range(32)]
    # The four in the middle would run into the first one; of the rest, the farthest behind are left out.
    places = [p for p in places if max(map(abs, p)) > 1][::-1][:1000]
    for x, z in places:
        turn = random.uniform(0, 2 * np.pi)
        m = np.eye(4)
        m[0, 0] = m[2, 2] = np.cos(turn)
        m[0, 2], m[2, 0] = np.sin(turn), -np.sin(turn)
        m[[0, 2], 3] = 6.5 * np.array([x, z]) + random.uniform(-0.4, 0.4, 2)
        out.append(m)
    return [[round(float(v), 9) for v in m.ravel()] for m in out]


def scenes():
    """All of them. A sky is the name of one of SKIES."""
    dragon = {"camera": DRAGON_CAMERA, "materials": {"body": CLAY}, "objects": [DRAGON], "integrator": "direct"}
    knot = {"camera": KNOT_CAMERA, "materials": {"body": CLAY}, "objects": [KNOT], "integrator": "direct"}
    grounded = {"materials": {"body": CLAY, "floor": FLOOR}, "objects": [DRAGON, GROUND]}
    herded = {"objects": [{"mesh": "dragon-871k.ply", "material": "body", "placements": herd()}]}
    return {
        "dragon-cube": {**dragon, "sky": "cube"},
        "dragon-sun": {**dragon, "sky": "sun"},
        "metal-sun": {**dragon, "sky": "sun", "materials": {"body": METAL}},
        "dragon-path": {**dragon, **grounded, "sky": "cube", "integrator": "path", "max_depth": 6},
        "primitives-nebula": {**knot, "camera": BALLS_CAMERA, "sky": "nebula", "objects": [ball(*b) for b in BALLS]},
        "instances": {**dragon, **herded, "camera": HERD_CAMERA, "sky": "cube"},
        "knot-midday": {**knot, "sky": "clear"},
        "knot-sun": {**knot, "sky": "midday"},
        "metal-knot": {**knot, "sky": "midday", "materials": {"body": METAL}},
    }


def skies(data):
    """As skylit is told of them. `clear` is midday without its disc."""
    cube = os.path.join(os.path.abspath(data), "scenes/seed/testscenes/skyboxes/above-sunset")
    return {
        "cube": f'type = "cube"\npath = {json.dumps(cube)}',
        "sun": 'type = "sphere"\npath = "sky-sun.exr"',
        "nebula": 'type = "nebula"',
        "clear": 'type = "midday"\nsun = false',
        "midday": 'type = "midday"',
    }


# Making what scenes refer to.


def sun_sky(path):
    """Radiance 1 + sin(elevation) / 4, and a sun of 4000: 0.5 degrees in radius, 45 up, on the camera's left."""
    w, h = 2048, 1024
    phi, theta = np.meshgrid(((np.arange(w) + 0.5) / w - 0.5) * 2 * np.pi, (0.5 - (np.arange(h) + 0.5) / h) * np.pi)
    d = np.stack([np.cos(theta) * np.cos(phi), np.sin(theta), np.cos(theta) * np.sin(phi)], -1)
    azimuth, elevation = np.radians(60), np.radians(45)
    cos, sin = np.cos(elevation), np.sin(elevation)
    sun = np.array([cos * np.cos(azimuth), sin, cos * np.sin(azimuth)])
    # By the chord: the arc cosine of nearly 1 is too coarse. The rim is soft by a texel.
    angle = 2 * np.arcsin(np.linalg.norm(d - sun, axis=-1) / 2)
    disc = np.clip((np.radians(0.5) - angle) / (np.pi / h) + 0.5, 0, 1)
    plane = 1 + 0.25 * d[..., 1] + 4000 * disc
    write_exr(path, {c: plane for c in "RGB"})


def benchmark_dragon(data, path):
    """Centred by its bounds, longest side 5.2, turned by 90 degrees about y (x to -z). In world space already, so that
    every program is given the same triangles."""
    positions, triangles = read_ply(data)
    low, high = positions.min(0), positions.max(0)
    p = (positions - (low + high) / 2) * (5.2 / (high - low).max())
    write_ply(path, np.stack([p[:, 2], p[:, 1], -p[:, 0]], -1), triangles)
    return path


def dragon_file(folder, name):
    path = os.path.join(folder, "meshes/ply", name)
    if not os.path.exists(path):
        raise Absent(f"no shared data ({name})")
    if not name.endswith(".zst"):
        with open(path, "rb") as f:
            return f.read()
    try:
        return subprocess.run(["zstd", "-dc", path], check=True, stdout=subprocess.PIPE).stdout
    except FileNotFoundError:
        raise Absent("no program `zstd`") from None


def ground(path, dragon):
    from files import load_ply

    y, side = load_ply(dragon)[0][:, 1].min(), 100
    corners = [[-side, y, -side], [-side, y, side], [side, y, side], [side, y, -side]]
    write_ply(path, corners, [[0, 1, 2], [0, 2, 3]])


def unit_ball(path):
    """An icosahedron whose faces are split in four seven times: 327,680 facets, within 3e-5 of the sphere."""
    g = (1 + 5**0.5) / 2
    p = np.array([(a, b, 0) for a in (-1, 1) for b in (-g, g)])
    p = np.concatenate([p, np.roll(p, 1, 1), np.roll(p, 2, 1)])
    near = np.linalg.norm(p[:, None] - p[None], axis=-1) < 2.1
    n = range(12)
    faces = [(i, j, k) for i in n for j in n for k in n if i < j < k and near[i, j] and near[j, k] and near[i, k]]
    out = lambda f: np.dot(np.cross(p[f[1]] - p[f[0]], p[f[2]] - p[f[0]]), p[f[0]]) > 0
    p, t = p / np.linalg.norm(p[0]), np.array([f if out(f) else f[::-1] for f in faces])
    for _ in range(7):
        edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), 1)
        unique, where = np.unique(edges, axis=0, return_inverse=True)
        middle = p[unique].sum(1)
        a, b, c = where.reshape(3, -1) + len(p)
        p = np.concatenate([p, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        i, j, k = t.T
        t = np.concatenate([np.stack(s, 1) for s in [(i, a, c), (a, j, b), (c, b, k), (a, b, c)]])
    write_ply(path, p, t)


class Maker:
    """Makes files in a folder, each once."""

    def __init__(self, a):
        self.folder, self.data = a.dir, a.data
        self.skylit, self.exporter = shlex.split(a.skylit), shlex.split(a.exporter)

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, words, cwd=None):
        try:
            subprocess.run(words, check=True, cwd=cwd, stdout=subprocess.DEVNULL)
        except FileNotFoundError:
            raise Absent(f"no program `{words[0]}`") from None
        except subprocess.CalledProcessError as e:
            raise Absent(f"`{words[0]}` failed with {e.returncode}") from None

    def mesh(self, name):
        path = self.path(name)
        if os.path.exists(path):
            return
        if name == "dragon.ply":
            benchmark_dragon(dragon_file(self.data, "dragon_vrip_res2.ply"), path)
        elif name == "dragon-871k.ply":
            benchmark_dragon(dragon_file(self.data, "dragon_vrip.ply.zst"), path)
        elif name == "ground.ply":
            self.mesh("dragon.ply")
            ground(path, self.path("dragon.ply"))
        elif name == "ball.ply":
            unit_ball(path)
        else:
            knot = os.path.join(HOME, "../floor/knot.toml")
            self.run([*self.exporter, knot, os.path.abspath(path)], cwd=HOME)

    def sky(self, name):
        """The picture of it that peers are given."""
        file = f"sky-{name}.exr"
        if os.path.exists(self.path(file)):
            return file
        if name == "sun":
            sun_sky(self.path(file))
            return file
        if name == "cube" and not os.path.isdir(os.path.join(self.data, "scenes")):
            raise Absent("no shared data (skyboxes)")
        toml = self.path(f"sky-{name}.toml")
        with open(toml, "w") as f:
            f.write(f"[film]\nsize = [{SKY_WIDTH}, {SKY_WIDTH // 2}]\n")
            f.write('[camera]\ntype = "equirectangular"\n[render]\nintegrator = "direct"\nspp = 64\n')
            f.write(f"[sky]\n{skies(self.data)[name]}\n")
        options = ["--full-float", "--filter", "box", "--quiet", "-o", self.path(file)]
        self.run([*self.skylit, "render", toml, *options])
        return file

    def scene(self, name, s):
        for o in s["objects"]:
            self.mesh(o["mesh"])
        sky = self.sky(s["sky"])
        objects = [{k: v for k, v in o.items() if k != "toml"} for o in s["objects"]]
        with open(self.path(f"{name}.toml"), "w") as f:
            f.write(toml(name, s, skies(self.data)[s["sky"]]))
        with open(self.path(f"{name}.json"), "w") as f:
            json.dump({"name": name, "size": SIZE, **s, "sky": sky, "objects": objects}, f, indent=1)
            f.write("\n")


def toml(name, s, sky):
    camera = "".join(f"{k} = {v}\n" for k, v in s["camera"].items())
    depth = f"max_depth = {s['max_depth']}\n" if "max_depth" in s else ""
    out = f"# The scene {name} of benches/peers, made by its scenes.py.\n[film]\nsize = {SIZE}\n"
    out += f'[camera]\ntype = "perspective"\n{camera}[render]\nintegrator = "{s["integrator"]}"\n{depth}[sky]\n{sky}\n'
    for key, material in s["materials"].items():
        words = material.get("toml", material)
        out += f"[materials.{key}]\n" + "".join(f"{k} = {json.dumps(v)}\n" for k, v in words.items())
    for i, o in enumerate(s["objects"]):
        shape = o.get("toml") or f'shape = {{ type = "mesh", path = "{o["mesh"]}" }}'
        if "placements" in o and "sphere" not in o:
            out += f'[groups.g{i}]\nobjects = [{{ {shape}, material = "{o["material"]}" }}]\n'
            for m in o["placements"]:
                out += f'[[objects]]\ngroup = "g{i}"\ntransform = [{{ matrix = {m} }}]\n'
        else:
            out += f'[[objects]]\n{shape}\nmaterial = "{o["material"]}"\n'
    return out


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("dir")
    p.add_argument("--only", help="names of scenes, with commas between")
    p.add_argument("--skylit", default="skylit", help="the program, which makes pictures of skies")
    exporter = "cargo run --release --example mesh_to_ply --"
    p.add_argument("--exporter", default=exporter, help=f"command that writes a scene as PLY; default: {exporter}")
    data = os.environ.get("SKYLIT_DATA") or os.path.join(HOME, "../../../shared/data")
    p.add_argument("--data", default=data, help="the shared test data; default: SKYLIT_DATA, or beside the crate")
    return p.parse_args()


def main():
    a = arguments()
    os.makedirs(a.dir, exist_ok=True)
    known = scenes()
    names = a.only.split(",") if a.only else list(known)
    for name in names:
        if name not in known:
            sys.exit(f"unknown scene {name}; known: {', '.join(known)}")
    maker = Maker(a)
    for name in names:
        try:
            maker.scene(name, known[name])
            print(f"{name}: written")
        except Absent as e:
            print(f"{name}: skipped: {e}")


if __name__ == "__main__":
    main()
