#!/usr/bin/env python3
"""Error against time of Mitsuba 3, for `skylit bench error --with RECORD`.

    pip install mitsuba numpy OpenEXR
    python3 benches/peers/peer_mitsuba.py DIR [SCENE ...] --json mitsuba.json [options]

The LLVM variant needs an LLVM library: its path goes into DRJIT_LIBLLVM_PATH where it is not found by itself.
"""
import time

import numpy as np

from ladder import arguments, missing, run

INSTALL = "pip install mitsuba numpy OpenEXR"
# Each makes compiled kernels longer: compiling for a thousand was never seen to end.
MOST_INSTANCES = 100


def direct(bsdf_only=False):
    return {"type": "direct", "emitter_samples": 0 if bsdf_only else 1, "bsdf_samples": 1}


def path(max_depth):
    # Mitsuba counts path edges: depth 2 is direct light.
    return {"type": "path", "max_depth": max_depth + 1, "rr_depth": 1000}


def diffuse(albedo):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [albedo] * 3}}}


def metal(roughness):
    """White; lit and seen from both sides, as skylit's."""
    bsdf = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": roughness**2}
    return {"type": "twosided", "bsdf": bsdf}


def material(m):
    return metal(m["roughness"]) if m["type"] == "metal" else diffuse(m["albedo"])


def sensor(mi, camera, size, sampler, rfilter="box", pixel_format="rgb"):
    to_world = mi.ScalarTransform4f().look_at(origin=camera["eye"], target=camera["look_at"], up=camera["up"])
    film = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "rfilter": {"type": rfilter},
        "pixel_format": pixel_format,
        "component_format": "float32",
    }
    view = {"type": "perspective", "fov": camera["fov_deg"], "fov_axis": "y", "to_world": to_world}
    return {**view, "film": film, "sampler": sampler}


def envmap(mi, sky):
    """`sky` in skylit's convention: Mitsuba's middle column looks along +z, a quarter of the width from ours. Its rows
    lie at v = j / (h - 1) where ours are at (j + 0.5) / h, so that a sun stands up to half a texel elsewhere."""
    rolled = np.roll(sky, -(sky.shape[1] // 4), axis=1)
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(rolled))}


def shapes(mi, scene):
    """Objects by name. What stands in several places is a group with instances of it."""
    out = {}
    for i, o in enumerate(scene.objects):
        bsdf = material(scene.materials[o["material"]])
        if "sphere" in o:
            out[f"object{i}"] = {"type": "sphere", **o["sphere"], "bsdf": bsdf}
            continue
        mesh = {"type": "ply", "filename": scene.path(o["mesh"]), "face_normals": True, "bsdf": bsdf}
        if "placements" not in o:
            out[f"object{i}"] = mesh
            continue
        out[f"group{i}"] = {"type": "shapegroup", "mesh": mesh}
        for j, m in enumerate(scene.placements(o)):
            group = {"type": "ref", "id": f"group{i}"}
            out[f"instance{i}-{j}"] = {"type": "instance", "to_world": mi.ScalarTransform4f(m), "group": group}
    return out


class Mitsuba:
    NAME = "mitsuba"

    def __init__(self, variant, threads, scalar_most):
        import drjit
        import mitsuba

        mitsuba.set_variant(variant)
        drjit.set_thread_count(threads)
        self.dr, self.mi, self.variant = drjit, mitsuba, variant
        self.program = f"Mitsuba {mitsuba.__version__} {variant}"
        # The variants mean the same.
        self.maker = f"Mitsuba {mitsuba.__version__} llvm_ad_rgb"
        # It takes more than twice as long: a few samples tell all that there is to say.
        self.most = scalar_most if variant == "scalar_rgb" else 1 << 30

    def series(self):
        """Multijitter is Mitsuba's best point set. Which strategy is better depends on the sky, so both are shown."""
        short = self.variant.split("_")[0]
        out = []
        for strategy in [s for s in ["mis", "bsdf"] if s in self.integrators]:
            settings = {"variant": self.variant, "sampler": "multijitter", "strategy": strategy}
            out.append({"name": f"Mitsuba {short} multijitter {strategy}", "settings": settings, "most": self.most})
        return out

    def refuses(self, scene):
        placed = sum(len(o.get("placements", [])) for o in scene.objects)
        if self.variant != "scalar_rgb" and placed > MOST_INSTANCES:
            return f"compiling for {placed} instances was never seen to end (scalar_rgb can)"

    def open(self, scene):
        mi = self.mi
        sampler = {"type": "multijitter", "sample_count": 4}
        view = sensor(mi, scene.camera, scene.size, sampler)
        self.alpha_sensor = mi.load_dict(sensor(mi, scene.camera, scene.size, sampler, pixel_format="rgba"))
        sky = envmap(mi, scene.sky_picture())
        self.scene = mi.load_dict({"type": "scene", "sensor": view, "sky": sky, **shapes(mi, scene)})
        # The path integrator has no strategy but MIS.
        if scene.integrator == "path":
            strategies = {"mis": path(scene.max_depth)}
        else:
            strategies = {"mis": direct(), "bsdf": direct(bsdf_only=True)}
        self.integrators = {name: mi.load_dict(i) for name, i in strategies.items()}

    def render(self, series, spp, seed):
        """Everything is loaded and built, and kernels are compiled if the same was rendered before."""
        integrator = self.integrators[series["settings"]["strategy"]]
        start = time.perf_counter()
        image = self.mi.render(self.scene, integrator=integrator, spp=spp, seed=seed)
        self.dr.eval(image)
        self.dr.sync_thread()
        return time.perf_counter() - start, np.array(image)

    def alpha(self, spp):
        # The other integrators count the sky as covered.
        depth = self.mi.load_dict({"type": "depth"})
        return np.array(self.mi.render(self.scene, sensor=self.alpha_sensor, integrator=depth, spp=spp))[..., 3]


def main():
    variants = {"default": "llvm_ad_rgb", "help": "llvm_ad_rgb or scalar_rgb"}
    most = {"type": int, "default": 16, "help": "most samples of scalar_rgb"}
    a = arguments(__doc__, [("--variant", variants), ("--scalar-most", most)])
    try:
        peer = Mitsuba(a.variant, a.threads, a.scalar_most)
    except ImportError as e:
        missing("Mitsuba", INSTALL, e)
    run(peer, a)


if __name__ == "__main__":
    main()
