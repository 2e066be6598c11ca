"""What the scripts of all peers do alike: options, scenes, references, and runs with ever more samples.

A peer is a class with
    NAME                       for file names
    program                    name and version, for the record
    maker                      the same of what makes references, where several programs share them
    series()                   list of {"name", "settings", optionally "most": largest number of samples}; the first
                               makes the reference
    open(scene)                loads what `Scene` describes
    render(series, spp, seed)  (seconds of rendering alone, picture of height x width x 3), linear
    alpha(spp)                 part of each pixel that surfaces cover
and, where it cannot render every scene,
    refuses(scene)             why it does not render this one; nothing if it does
"""
import argparse
import json
import os
import sys
import zlib

import numpy as np

from files import read_exr
from measure import EPSILON, Reference, write_record

# Seeds of references lie apart from those of runs.
REFERENCE_SEED = 500_000
# Samples of all pixels of one picture of a reference: few enough for a peer that keeps them in memory.
MOST_AT_ONCE = 1 << 24
# Samples that tell whether a pixel is wholly covered.
ALPHA_SPP = 256


class Scene:
    """A NAME.json of scenes.py."""

    def __init__(self, folder, name, size):
        path = os.path.join(folder, f"{name}.json")
        try:
            with open(path) as f:
                self.__dict__.update(json.load(f))
        except FileNotFoundError:
            raise SystemExit(f"no {path}: make it with scenes.py, or leave {name} out") from None
        self.folder = folder
        self.size = size or self.size

    def path(self, name):
        return os.path.join(self.folder, name)

    def sky_picture(self):
        """The sky as skylit has it: u = 0.5 + atan2(z, x) / 2 pi, the first row is up."""
        planes, _ = read_exr(self.path(self.sky))
        return np.ascontiguousarray(np.stack([planes[c] for c in "RGB"], -1), dtype=np.float32)

    @staticmethod
    def placements(o):
        return [np.array(m, dtype=np.float64).reshape(4, 4) for m in o.get("placements", [np.eye(4).ravel()])]


def size(text):
    return [int(n) for n in text.split("x")]


def numbers(text):
    return sorted(int(n) for n in text.split(","))


def arguments(doc, more=()):
    p = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("dir", help="folder of scenes.py")
    p.add_argument("scenes", nargs="*", help="names; default: all that are in the folder")
    p.add_argument("--spp", type=numbers, default=[4, 16, 64, 256], help="samples a pixel, with commas between")
    p.add_argument("--replicates", type=int, default=8, help="runs of each, with seeds of their own")
    p.add_argument("--reference-spp", type=int, help="default: 64 times the most samples")
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--size", type=size, help="WxH; default: the scenes' 480x270")
    p.add_argument("--json", required=True, help="the record to write; it grows scene by scene")
    for name, options in more:
        p.add_argument(name, **options)
    a = p.parse_args()
    a.reference_spp = a.reference_spp or 64 * a.spp[-1]
    if not a.scenes:
        a.scenes = sorted(n[:-5] for n in os.listdir(a.dir) if n.endswith(".json"))
    return a


def missing(name, install, error):
    """What a script says where its renderer is not installed."""
    sys.exit(f"cannot load {name}: {error}\ninstall it with: {install}")


def half(peer, series, spp, seed, pixels):
    """Mean of independent pictures."""
    pictures = -(-spp * pixels // MOST_AT_ONCE)
    total = sum(peer.render(series, -(-spp // pictures), seed + i)[1].astype(np.float64) for i in range(pictures))
    return total / pictures


def reference(peer, scene, a):
    """The one that was kept, or a new one. Kept ones belong to the scene's description and the peer's version."""
    with open(scene.path(f"{scene.name}.json"), "rb") as f:
        key = f"{zlib.crc32(f.read() + getattr(peer, 'maker', peer.program).encode()):08x}"
    w, h = scene.size
    folder = scene.path("references")
    path = os.path.join(folder, f"{scene.name}-{peer.NAME}-{w}x{h}-{a.reference_spp}-{key}.exr")
    if os.path.exists(path):
        return Reference.load(path)
    series = peer.series()[0]
    spp = max(a.reference_spp // 2, 1)
    halves = [half(peer, series, spp, REFERENCE_SEED + i * 10_000, w * h) for i in range(2)]
    made = Reference.of_halves(*halves, peer.alpha(min(a.reference_spp, ALPHA_SPP)), a.reference_spp)
    os.makedirs(folder, exist_ok=True)
    made.save(path)
    return made


def run(peer, a):
    done = []
    for name in a.scenes:
        scene = Scene(a.dir, name, a.size)
        reason = peer.refuses(scene) if hasattr(peer, "refuses") else None
        if reason:
            print(f"{peer.program}: {name} left out: {reason}", file=sys.stderr)
            continue
        peer.open(scene)
        truth = reference(peer, scene, a)
        series = [measure(peer, s, truth, a) for s in peer.series()]
        done.append(
            {
                "name": scene.name,
                "size": scene.size,
                "epsilon": EPSILON,
                "reference": truth.record(),
                "series": [s for s in series if s["points"]],
            }
        )
        write_record(a.json, peer.program, a.threads, done)


def measure(peer, series, truth, a):
    points = []
    for spp in a.spp:
        if spp > series.get("most", spp):
            continue
        # Not counted: compilation for this number of samples, and whatever is built at the first render.
        peer.render(series, spp, 0)
        runs = []
        for i in range(a.replicates):
            seconds, picture = peer.render(series, spp, 1 + i)
            runs.append({"seconds": seconds, **truth.errors(picture)})
        points.append({"spp": spp, "runs": runs})
        mean = lambda get: sum(map(get, runs)) / len(runs)
        time, error = mean(lambda r: r["seconds"]), mean(lambda r: r["surfaces"]["relmse"])
        print(f"{series['name']}, {spp} spp: {time:.3f} s, relmse of surfaces {error:.3g}", file=sys.stderr)
    return {"name": series["name"], "program": peer.program, "settings": series["settings"], "points": points}
