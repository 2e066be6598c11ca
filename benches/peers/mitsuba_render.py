#!/usr/bin/env python3
"""Renders one mesh under one equirectangular sky with Mitsuba 3, for comparison with skylit.

    pip install mitsuba numpy
    python3 benches/peers/mitsuba_render.py MESH.ply SKY.exr -o out.exr [options]

SKY.exr is equirectangular in skylit's convention (the middle column looks along +x); skylit writes such a picture of
any sky with the camera type "equirectangular" (see benches/README.md). Times go to stdout as JSON: `first` includes
the compilation of the LLVM variants' kernel, `render` is the median of the later runs.

With --against 'skylit render ... --stats FILE.json' that command is run after each of the later runs, so that the two
alternate on one machine, and its own time for rendering (not for loading) is set beside Mitsuba's: `ratio` is the
median of the pairs.
"""
import argparse
import json
import shlex
import statistics
import subprocess
import time

import numpy as np

from peer_mitsuba import diffuse, direct, envmap, metal, path, sensor


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("mesh")
    p.add_argument("sky")
    p.add_argument("-o", "--output", required=True)
    p.add_argument("--variant", default="llvm_ad_rgb", choices=["llvm_ad_rgb", "scalar_rgb"])
    p.add_argument("--size", default="1920x1080")
    p.add_argument("--spp", type=int, default=50)
    p.add_argument("--runs", type=int, default=5)
    p.add_argument("--threads", type=int, default=0, help="0 means all cores")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--integrator", default="direct", choices=["direct", "direct-bsdf", "path", "depth"])
    p.add_argument("--max-depth", type=int, default=6, help="surfaces, the camera's hit counted as 1")
    p.add_argument("--sampler", default="multijitter")
    p.add_argument("--rfilter", default="box")
    p.add_argument("--albedo", type=float, default=0.8)
    p.add_argument("--metal-roughness", type=float, help="a white GGX conductor instead of diffuse; alpha = roughness^2")
    p.add_argument("--eye", default="5,0,0")
    p.add_argument("--look-at", default="0,0,0")
    p.add_argument("--fov", type=float, default=60.0)
    p.add_argument("--fit", type=float, help="centre the mesh by its bounds and scale its longest side to this")
    p.add_argument("--against", help="a skylit command with --stats, to alternate with")
    p.add_argument("--rotate-y", type=float, default=0.0, help="degrees, after --fit")
    return p.parse_args()


def integrator(a):
    if a.integrator == "depth":
        return {"type": "depth"}
    return path(a.max_depth) if a.integrator == "path" else direct(bsdf_only=a.integrator == "direct-bsdf")


def scene(mi, a):
    T = mi.ScalarTransform4f
    bsdf = diffuse(a.albedo) if a.metal_roughness is None else metal(a.metal_roughness)
    mesh = {"type": "obj" if a.mesh.lower().endswith(".obj") else "ply", "filename": a.mesh, "bsdf": bsdf}
    if a.fit:
        box = mi.load_dict({**mesh, "face_normals": True}).bbox()
        size = max(box.max[i] - box.min[i] for i in range(3))
        mesh["to_world"] = (
            T().rotate([0, 1, 0], a.rotate_y) @ T().scale(a.fit / size) @ T().translate([-c for c in box.center()])
        )
    sky = np.array(mi.Bitmap(a.sky).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    size = list(map(int, a.size.split("x")))
    vector = lambda s: [float(x) for x in s.split(",")]
    camera = {"eye": vector(a.eye), "look_at": vector(a.look_at), "up": [0, 1, 0], "fov_deg": a.fov}
    sampler = {"type": a.sampler, "sample_count": a.spp}
    return {
        "type": "scene",
        "integrator": integrator(a),
        "mesh": mesh,
        "sky": envmap(mi, sky),
        "sensor": sensor(mi, camera, size, sampler, a.rfilter),
    }


def other_seconds(command):
    words = shlex.split(command)
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with open(words[words.index("--stats") + 1]) as f:
        return json.load(f)["seconds"]["render"]


def main():
    a = arguments()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(a.variant)
    if a.threads:
        dr.set_thread_count(a.threads)
    start = time.perf_counter()
    built = mi.load_dict(scene(mi, a))
    load = time.perf_counter() - start
    times, others = [], []
    image = None
    for i in range(a.runs + 1):
        start = time.perf_counter()
        image = mi.render(built, spp=a.spp, seed=a.seed + i)
        dr.eval(image)
        dr.sync_thread()
        times.append(time.perf_counter() - start)
        if a.against and i > 0:
            others.append(other_seconds(a.against))
    mi.Bitmap(image).write(a.output)
    later = times[1:] or times
    print(
        json.dumps(
            {
                "program": "mitsuba " + mi.__version__,
                "variant": a.variant,
                "integrator": a.integrator,
                "sampler": a.sampler,
                "size": a.size,
                "spp": a.spp,
                "load": load,
                "first": times[0],
                "render": statistics.median(later),
                "runs": times,
                "skylit": others,
                "ratio": statistics.median(m / o for m, o in zip(later, others)) if others else None,
            }
        )
    )


if __name__ == "__main__":
    main()
