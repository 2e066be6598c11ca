#!/usr/bin/env python3
"""Error against time of Cycles, for `skylit bench error --with RECORD`.

    pip install bpy OpenEXR          # bpy 5.0 wants Python 3.11
    python3 benches/peers/peer_cycles.py DIR [SCENE ...] --json cycles.json [options]
"""
import os
import tempfile

import numpy as np

from files import load_ply, read_exr, rgb
from ladder import arguments, missing, run

INSTALL = "pip install bpy OpenEXR (each bpy has wheels for one version of Python: 5.0 for 3.11)"

# From skylit's axes (y up) to Blender's (z up): x, y, z to x, -z, y. Skies need no turn then: Blender's equirectangular
# column is 0.5 - atan2(y, x) / 2 pi.
AXES = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def seconds(text):
    """Of Blender's way to write a duration: [HH:]MM:SS.ss."""
    total = 0.0
    for part in text.split(":"):
        total = total * 60 + float(part)
    return total


class Cycles:
    NAME = "cycles"

    def __init__(self, threads):
        import bpy

        self.bpy, self.threads = bpy, threads
        self.program = f"Cycles {bpy.app.version_string}"
        self.folder = tempfile.TemporaryDirectory()

    @staticmethod
    def matrix(m):
        from mathutils import Matrix

        # Plain lists would be taken column by column.
        return Matrix((AXES @ m).tolist())

    def series(self):
        settings = {"sampler": "tabulated Sobol", "strategy": "mis"}
        return [{"name": "Cycles tabulated Sobol mis", "settings": settings}]

    def open(self, scene):
        bpy = self.bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        s = self.scene = bpy.context.scene
        s.render.engine = "CYCLES"
        s.render.resolution_x, s.render.resolution_y = scene.size
        s.render.resolution_percentage = 100
        s.render.threads_mode, s.render.threads = "FIXED", self.threads
        # With data kept from render to render, part of carrying the scene over counts as rendering.
        s.render.use_persistent_data = False
        s.render.image_settings.file_format = "OPEN_EXR"
        s.render.image_settings.color_mode = "RGBA"
        s.render.image_settings.color_depth = "32"
        s.render.use_compositing = s.render.use_sequencer = False
        # The times that Cycles took stand in the picture's header.
        s.render.use_stamp_render_time = True
        self.settings(s.cycles, scene)
        self.camera(scene)
        self.world(scene)
        for i, o in enumerate(scene.objects):
            self.object(scene, i, o)

    def settings(self, c, scene):
        """Plain path tracing by the textbook: no shortcut that changes the mean, nothing that filters."""
        c.device = "CPU"
        c.sampling_pattern = "TABULATED_SOBOL"
        c.direct_light_sampling_type = "MULTIPLE_IMPORTANCE_SAMPLING"
        c.use_denoising = c.use_adaptive_sampling = c.use_guiding = c.use_fast_gi = False
        c.auto_scrambling_distance = False
        # There is one light: a tree of them has nothing to choose.
        c.use_light_tree = False
        # Shadow rays of little weight are kept: dropping them at random makes noise.
        c.light_sampling_threshold = 0
        c.sample_clamp_direct = c.sample_clamp_indirect = 0
        c.blur_glossy = 0
        c.caustics_reflective = c.caustics_refractive = True
        c.pixel_filter_type, c.filter_width = "BOX", 1
        c.use_auto_tile = False
        # Blender counts bounces after the camera's hit, whose direct light comes without any.
        bounces = scene.max_depth - 1 if scene.integrator == "path" else 0
        c.max_bounces = c.diffuse_bounces = c.glossy_bounces = bounces

    def camera(self, scene):
        bpy, c = self.bpy, scene.camera
        eye, at, up = (np.array(c[k], dtype=np.float64) for k in ["eye", "look_at", "up"])
        back = (eye - at) / np.linalg.norm(eye - at)
        right = np.cross(up, back)
        right /= np.linalg.norm(right)
        m = np.eye(4)
        m[:3] = np.stack([right, np.cross(back, right), back, eye], 1)
        data = bpy.data.cameras.new("camera")
        data.sensor_fit = "VERTICAL"
        data.angle = np.radians(c["fov_deg"])
        data.clip_start, data.clip_end = 1e-3, 1e5
        it = bpy.data.objects.new("camera", data)
        it.matrix_world = self.matrix(m)
        self.scene.collection.objects.link(it)
        self.scene.camera = it

    def world(self, scene):
        bpy = self.bpy
        world = self.scene.world = bpy.data.worlds.new("sky")
        world.use_nodes = True
        nodes = world.node_tree.nodes
        texture = nodes.new("ShaderNodeTexEnvironment")
        texture.image = bpy.data.images.load(os.path.abspath(scene.path(scene.sky)))
        texture.image.colorspace_settings.name = "Linear Rec.709"
        # Half floats end at 65504, which a sun may exceed.
        texture.image.use_half_precision = False
        texture.interpolation = "Linear"
        background = next(n for n in nodes if n.type == "BACKGROUND")
        world.node_tree.links.new(texture.outputs["Color"], background.inputs["Color"])
        background.inputs["Strength"].default_value = 1
        # Twice as fine as the picture. Where cells are texels, those beside a sun have the density of dim sky at their
        # middle but half the sun at their edge, and the picture twenty times the variance.
        world.cycles.sampling_method = "MANUAL"
        world.cycles.sample_map_resolution = min(2 * texture.image.size[0], 8192)

    def material(self, m):
        material = self.bpy.data.materials.new("material")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        if m["type"] == "metal":
            bsdf = tree.nodes.new("ShaderNodeBsdfAnisotropic")
            # One reflection off the facets; roughness is the root of alpha, as skylit's.
            bsdf.distribution = "GGX"
            bsdf.inputs["Roughness"].default_value = m["roughness"]
            bsdf.inputs["Color"].default_value = [m["color"]] * 3 + [1]
        else:
            bsdf = tree.nodes.new("ShaderNodeBsdfDiffuse")
            bsdf.inputs["Roughness"].default_value = 0
            bsdf.inputs["Color"].default_value = [m["albedo"]] * 3 + [1]
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(bsdf.outputs[0], output.inputs["Surface"])
        return material

    def object(self, scene, i, o):
        bpy = self.bpy
        positions, triangles = load_ply(scene.path(o["mesh"]))
        mesh = bpy.data.meshes.new(f"mesh{i}")
        mesh.vertices.add(len(positions))
        mesh.vertices.foreach_set("co", positions.ravel())
        mesh.loops.add(triangles.size)
        mesh.loops.foreach_set("vertex_index", triangles.ravel())
        mesh.polygons.add(len(triangles))
        mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
        mesh.update(calc_edges=True)
        mesh.shade_flat()
        mesh.materials.append(self.material(scene.materials[o["material"]]))
        for j, m in enumerate(scene.placements(o)):
            it = bpy.data.objects.new(f"object{i}-{j}", mesh)
            it.matrix_world = self.matrix(m)
            self.scene.collection.objects.link(it)

    def image(self, spp, seed):
        s = self.scene
        s.cycles.samples, s.cycles.seed = spp, seed
        path = os.path.join(self.folder.name, "picture.exr")
        s.render.filepath = path
        self.bpy.ops.render.render(write_still=True)
        return read_exr(path)

    def render(self, series, spp, seed):
        """What Cycles calls render time, to 10 ms: that of tracing paths, after the scene was carried over."""
        planes, header = self.image(spp, seed)
        times = [seconds(v) for k, v in header.items() if k.startswith("cycles.") and k.endswith(".render_time")]
        return max(times[0], 0.005), rgb(planes)

    def alpha(self, spp):
        # Alpha is known only where the sky is not drawn.
        self.scene.render.film_transparent = True
        planes, _ = self.image(spp, 0)
        self.scene.render.film_transparent = False
        return planes["A"]


def main():
    a = arguments(__doc__)
    try:
        peer = Cycles(a.threads)
    except ImportError as e:
        missing("Cycles", INSTALL, e)
    run(peer, a)


if __name__ == "__main__":
    main()
