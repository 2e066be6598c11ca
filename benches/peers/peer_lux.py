#!/usr/bin/env python3
"""Error against time of LuxCore, for `skylit bench error --with RECORD`.

    pip install pyluxcore numpy OpenEXR
    python3 benches/peers/peer_lux.py DIR [SCENE ...] --json lux.json [options]
"""
import os
import sys
import tempfile
import time

import numpy as np

from files import write_exr
from ladder import arguments, missing, run

INSTALL = "pip install pyluxcore numpy OpenEXR"


class Lux:
    NAME = "lux"

    def __init__(self, threads):
        # First, as pyluxcore brings an allocator along that cannot free what libraries loaded later made with another.
        import OpenEXR
        import pyluxcore

        self.lux, self.threads = pyluxcore, threads
        self.plain = {"compression": OpenEXR.NO_COMPRESSION}
        pyluxcore.Init(lambda message: None)
        self.program = f"LuxCore {pyluxcore.Version()}"
        self.folder = tempfile.TemporaryDirectory()

    def series(self):
        return [{"name": "LuxCore Sobol mis", "settings": {"sampler": "SOBOL", "strategy": "mis"}}]

    def properties(self, table):
        out = self.lux.Properties()
        for key, value in table.items():
            out.Set(self.lux.Property(key, value if isinstance(value, list) else [value]))
        return out

    def open(self, scene):
        self.size = scene.size
        # One more than ours: Lux takes no light at its last vertex, unless that is the first one, too, where it samples the
        # sky alone, without a ray of the material's, so that half of its directions are under the horizon.
        self.depth = 1 + (scene.max_depth if scene.integrator == "path" else 1)
        self.scene = self.lux.Scene()
        eye, at, up = (scene.camera[k] for k in ["eye", "look_at", "up"])
        table = {
            "scene.camera.type": "perspective",
            "scene.camera.lookat.orig": eye,
            "scene.camera.lookat.target": at,
            "scene.camera.up": up,
            **self.window(scene),
            "scene.camera.lensradius": 0.0,
            "scene.camera.autofocus.enable": False,
            **self.sky(scene),
        }
        for name, m in scene.materials.items():
            table |= self.material(f"scene.materials.{name}", m)
        for i, o in enumerate(scene.objects):
            table |= self.object(scene, i, o)
        self.scene.Parse(self.properties(table))

    @staticmethod
    def window(scene):
        """Lux' angle of view is that of the picture's longer side; ours is upright. Its rows stand one too low."""
        w, h = scene.size
        long = max(w, h)
        tan = np.tan(np.radians(scene.camera["fov_deg"]) / 2) * long / h
        x, y, row = w / long, h / long, 2 / long
        return {
            "scene.camera.fieldofview": float(2 * np.degrees(np.arctan(tan))),
            "scene.camera.autoupdate.screenwindow": False,
            "scene.camera.screenwindow": [-x, x, -y - row, y - row],
        }

    def sky(self, scene):
        """Lux' first column looks along +x, and its upright axis is z."""
        sky = scene.sky_picture()
        rolled = np.roll(sky, sky.shape[1] // 2, axis=1)
        path = os.path.join(self.folder.name, f"{scene.name}.exr")
        write_exr(path, {c: rolled[..., i] for i, c in enumerate("RGB")}, self.plain)
        return {
            "scene.lights.sky.type": "infinite",
            "scene.lights.sky.file": path,
            "scene.lights.sky.gamma": 1.0,
            "scene.lights.sky.storage": "float",
            # Texels of one radiance, as the table of directions has them: between bilinear ones, a bright texel's rim is
            # sampled by its dark neighbour's density, which makes fireflies (100 x the variance under stars).
            "scene.lights.sky.filter": "nearest",
            "scene.lights.sky.visibilitymapcache.enable": False,
            # From x, z, y: a mirror, as Lux counts azimuths the other way round.
            "scene.lights.sky.transformation": [1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1],
        }

    @staticmethod
    def material(key, m):
        if m["type"] == "metal":
            # Schlick's facets with squared widths are those of GGX, their masking is another. The index makes it white.
            alpha = m["roughness"] ** 2
            table = {"type": "metal2", "uroughness": alpha, "vroughness": alpha, "n": [0.001] * 3, "k": [50.0] * 3}
        else:
            table = {"type": "matte", "kd": [m["albedo"]] * 3}
        return {f"{key}.{k}": v for k, v in table.items()}

    @staticmethod
    def object(scene, i, o):
        table = {f"scene.shapes.mesh{i}.type": "mesh", f"scene.shapes.mesh{i}.ply": scene.path(o["mesh"])}
        for j, m in enumerate(scene.placements(o)):
            key = f"scene.objects.object{i}-{j}"
            table |= {f"{key}.shape": f"mesh{i}", f"{key}.material": o["material"]}
            if "placements" in o:
                # Column by column.
                table[f"{key}.transformation"] = [float(v) for v in m.T.ravel()]
        return table

    def config(self, spp, seed):
        return {
            "renderengine.type": "PATHCPU",
            "renderengine.seed": seed + 1,
            "native.threads.count": self.threads,
            "sampler.type": "SOBOL",
            # Samples go to all pixels alike.
            "sampler.sobol.adaptive.strength": 0.0,
            "path.pathdepth.total": self.depth,
            "path.pathdepth.diffuse": self.depth,
            "path.pathdepth.glossy": self.depth,
            "path.pathdepth.specular": self.depth,
            "path.russianroulette.depth": 1000,
            "path.clamping.variance.maxvalue": 0.0,
            "path.hybridbackforward.enable": False,
            "film.width": self.size[0],
            "film.height": self.size[1],
            "film.filter.type": "BOX",
            "film.filter.width": 0.5,
            "film.imagepipelines.0.0.type": "NOP",
            "film.outputs.0.type": "RGB",
            "film.outputs.0.filename": "rgb.exr",
            "film.outputs.1.type": "ALPHA",
            "film.outputs.1.filename": "alpha.exr",
            "batch.haltspp": spp,
        }

    def session(self, spp, seed):
        """Seconds from the start of the threads, which the scene is built before, until the samples are there."""
        config = self.lux.RenderConfig(self.properties(self.config(spp, seed)), self.scene)
        session = self.lux.RenderSession(config)
        session.Start()
        start = time.perf_counter()
        while not session.HasDone():
            time.sleep(0.01)
            session.UpdateStats()
        elapsed = time.perf_counter() - start
        session.Stop()
        return elapsed, session

    def output(self, session, kind, channels):
        w, h = self.size
        buffer = np.zeros(w * h * channels, np.float32)
        session.GetFilm().GetOutputFloat(kind, buffer, 0, True)
        # Lux' first row is at the bottom.
        return buffer.reshape(h, w, channels)[::-1].copy()

    def render(self, series, spp, seed):
        elapsed, session = self.session(spp, seed)
        return elapsed, self.output(session, self.lux.FilmOutputType.RGB, 3)

    def alpha(self, spp):
        _, session = self.session(spp, 0)
        return self.output(session, self.lux.FilmOutputType.ALPHA, 1)[..., 0]


def main():
    a = arguments(__doc__)
    try:
        peer = Lux(a.threads)
    except ImportError as e:
        missing("LuxCore", INSTALL, e)
    run(peer, a)
    # All is written. Python's way out ends in a fault of pyluxcore's threads.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
