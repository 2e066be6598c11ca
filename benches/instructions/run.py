#!/usr/bin/env python3
"""Instructions of skylit by callgrind: what a scene pays for features that it does not use, and for pixels of bare sky.

    cargo build --release && python3 benches/instructions/run.py [--skylit PROGRAM] [--only unused|sky] [--json FILE]

Counts hardly depend on what else the machine does, so that differences far below one per cent show. Needs valgrind; takes
some ten minutes. One thread, the in-house kernel (valgrind cannot run the code that Embree picks on processors with
AVX-512) and AVX2 at most (SKYLIT_SIMD).

`unused`: a mesh under a sky, and the same scene where something more is declared that no ray meets or that says what is
the default anyway. Instructions a sample are the difference of two renders with 16 and 48 samples a pixel, over the
difference of their samples, so that loading, building and writing do not count. Asked: at most 1.01 times those of the
plain scene. Rows in brackets are for information: there the feature is used.

`sky`: instructions a pixel of pictures that show nothing but surface and nothing but sky, at 16 and 64 samples a pixel:
the difference of two sizes of the same picture over the difference of their pixels. That includes all that a pixel
takes: the film, the file. The mesh lies beside the picture, or the picture shows the sky through its hole. Asked: at 16
samples, a pixel of sky takes at most 2 % of one of surface, where that takes the least: direct light by one light sample
and one ray on. Rows in brackets are for information: surfaces by the strategy that skylit chooses itself, a ray for every
sample of the sky, and all of 64 samples, which is the default (what a pixel of sky takes hardly depends on it).

Exit code 1 if something is above what is asked.
"""
import argparse
import json
import os
import re
import struct
import subprocess
import sys
import tempfile
import zlib

MOST_UNUSED = 1.01
MOST_SKY = 0.02
SPP = (16, 48)
# The small picture, so that most of it is surface, and the two sizes of the second part. The smaller one still has enough
# samples for skylit to look which pixels are bare.
SIZE = (96, 54)
SIZES = ((64, 36), (128, 72))
SKY_SPP = (16, 64)

PLAIN = {
    "film": "",
    "camera": 'type = "perspective"\neye = [0, 0.9, 4.5]\nlook_at = [0, 0, 0]\nfov_deg = 42.0\n',
    "render": 'integrator = "path"\n',
    "sky": 'type = "midday"\n',
    "materials.clay": 'type = "diffuse"\nalbedo = 0.8\n',
    "object": 'name = "knot"\nshape = { type = "knot", triangles = 10000 }\nmaterial = "clay"\n',
    "placed": "transform = [{ rotate_deg = 70, axis = [1, 0, 0] }]\n",
}

# Name, and what is added to sections of the plain scene; a section that is not there is made.
UNUSED = (
    ("the same again", {}),
    ("a metal that nothing is made of", {"materials.copper": 'type = "metal"\nmetal = "copper"\nroughness = 0.3\n'}),
    ("a glass", {"materials.glass": 'type = "dielectric"\n'}),
    ("a material that glows", {"materials.lamp": 'type = "emissive"\nradiance = 5.0\n'}),
    ("a picture on a material", {"materials.wood": 'type = "diffuse"\nalbedo = { texture = "wood.png" }\n'}),
    ("a group that is not placed", {
        "groups.rocks": "objects = [{ shape = { type = \"displaced_sphere\", triangles = 2000 } }, "
                        "{ shape = { type = \"sphere\" } }]\n"}),
    ("a lens of no width", {"camera": "aperture = 0.0\nfocus_distance = 3.0\n"}),
    ("a sky turned by 0 and scaled by 1", {"sky": "rotate_y_deg = 0.0\nintensity = 1.0\n"}),
    ("a choice among one light", {"render": 'light_sampler = "tree"\n'}),
    ("background, curve and filter by name", {
        "film": 'background = "sky"\ntransfer = "srgb"\nfilter = "blackman-harris"\n'}),
    ("all of these", None),
)
USED = (
    ("a lamp of no power", {"lights": 'type = "point"\nposition = [0, 3, 0]\nintensity = 0.0\n'}),
    ("a picture on the mesh", {"materials.clay": ("albedo = 0.8", 'albedo = { texture = "wood.png" }')}),
    ("a layer of albedo", "--aov albedo"),
)

LOOKS = {
    "surface": "eye = [6.5, 0, 0]\nlook_at = [1.45, 0, 0]\nfov_deg = 1.0\n",
    "sky beside the mesh": "eye = [6.5, 0, 0]\nlook_at = [13, 2, 0]\nfov_deg = 20.0\n",
    "sky through the hole": "eye = [0, 6.5, 0]\nlook_at = [0, 0, 0]\nup = [0, 0, 1]\nfov_deg = 2.0\n",
}


def scene(changes):
    """The text of the plain scene with changes: text to be added to a section, or a pair to be exchanged there."""
    sections = dict(PLAIN)
    for name, change in changes.items():
        old = sections.get(name, "")
        sections[name] = old.replace(*change) if isinstance(change, tuple) else old + change
    placed = sections.pop("placed")
    heads = {"object": "[[objects]]", "lights": "[[lights]]"}
    text = [f"{heads.get(name, f'[{name}]')}\n{body}" for name, body in sections.items()]
    # The object's transform belongs to its table, which need not be the last.
    return "".join(t + placed if t.startswith("[[objects]]") else t for t in text)


def write_picture(path):
    """A PNG of 64 x 64 pixels."""
    side = 64
    rows = b"".join(b"\0" + bytes((x * y + c * 40) % 256 for x in range(side) for c in range(3)) for y in range(side))
    with open(path, "wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n")
        header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
        for kind, data in ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")):
            checksum = zlib.crc32(kind + data)
            out.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum))


class Counter:
    """Runs skylit under callgrind on scenes in a folder of its own."""

    def __init__(self, program, folder):
        self.program, self.folder, self.runs = program, folder, []
        write_picture(os.path.join(folder, "wood.png"))

    def render(self, name, text, size, spp, flags=()):
        """The instructions of a render, and what skylit says about it."""
        path = lambda end: os.path.join(self.folder, end)
        with open(path("scene.toml"), "w") as out:
            out.write(text)
        words = [self.program, "render", path("scene.toml"), "-o", path("out.exr"), "--stats", path("stats.json"),
                 "--size", f"{size[0]}x{size[1]}", "--spp", str(spp), "--seed", "1", "--dealing", "even", "--backend", "bvh",
                 "--threads", "1", "--quiet", *flags]
        valgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
        done = subprocess.run(valgrind + words, env={**os.environ, "SKYLIT_SIMD": "avx2"},
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        found = re.search(r"Collected\s*:\s*([\d,]+)", done.stderr)
        if done.returncode != 0 or not found:
            sys.exit(f"{' '.join(words)}\n{done.stderr}")
        with open(path("stats.json")) as f:
            stats = json.load(f)
        count = int(found[1].replace(",", ""))
        self.runs.append({"scene": name, "size": size, "spp": spp, "flags": list(flags), "instructions": count})
        return count, stats

    def a_sample(self, name, text, flags=()):
        """Instructions that a further sample takes."""
        (few, _), (many, stats) = (self.render(name, text, SIZE, spp, flags) for spp in SPP)
        return (many - few) / (SIZE[0] * SIZE[1] * (SPP[1] - SPP[0])), stats["decided"]

    def a_pixel(self, name, text, spp, flags=()):
        """Instructions that a further pixel takes, and what part of the larger picture's samples met a surface."""
        (few, _), (many, stats) = (self.render(name, text, size, spp, flags) for size in SIZES)
        pixels = [w * h for w, h in SIZES]
        points = (stats["skipped"] or {}).get("surface_points", 0)
        return (many - few) / (pixels[1] - pixels[0]), points / (pixels[1] * spp)


def unused(counter):
    """The first table; whether all is as asked."""
    rows = [(name, change, True) for name, change in UNUSED] + [(name, change, False) for name, change in USED]
    base, decided = counter.a_sample("plain", scene({}))
    print(f"{'what is declared':44} {'instructions a sample':>22} {'ratio':>8}")
    print(f"{'nothing more (' + (decided or 'nothing decided') + ')':44} {base:22.1f} {1:8.4f}")
    fine = True
    for name, change, counts in rows:
        flags = change.split() if isinstance(change, str) else ()
        if change is None:
            change = {}
            for _, other in UNUSED[:-1]:
                change.update(other)
        count, _ = counter.a_sample(name, scene({} if flags else change), flags)
        fine &= count <= MOST_UNUSED * base or not counts
        print(f"{name if counts else f'({name})':44} {count:22.1f} {count / base:8.4f}", flush=True)
    print(f"asked: at most {MOST_UNUSED}: {'met' if fine else 'missed'}\n")
    return fine


def looking(look, strategy):
    """The mesh alone, seen from elsewhere, by direct light."""
    return scene({
        "camera": (PLAIN["camera"], 'type = "perspective"\n' + LOOKS[look]),
        "render": (PLAIN["render"], f'integrator = "direct"\nstrategy = "{strategy}"\n'),
        "object": ("10000", "2000"),
        "placed": (PLAIN["placed"], ""),
    })


def sky(counter):
    """The second table; whether all is as asked."""
    fine = True
    print(f"{'a pixel of':52} {'instructions a pixel':>21} {'of surface':>11}")
    for spp in SKY_SPP:
        surface = None
        rows = [("surface", "both", "integrate"), ("surface", "auto", "integrate")]
        rows += [(look, "both", pixels) for look in list(LOOKS)[1:] for pixels in ("integrate", "sample")]
        for look, strategy, pixels in rows:
            flags = ("--sky-pixels", pixels)
            count, part = counter.a_pixel(look, looking(look, strategy), spp, flags)
            # By the pilot's choice, a surface point may take several samples; it is met once a sample all the same.
            if strategy == "both" and part != float(look == "surface"):
                sys.exit(f"{look}: {part:.3f} of the samples met a surface")
            surface = surface or count
            asked = spp == SKY_SPP[0] and strategy == "both" and pixels == "integrate"
            fine &= look == "surface" or not asked or count <= MOST_SKY * surface
            how = ", strategy by a pilot" if strategy == "auto" else ", a ray a sample" if pixels == "sample" else ""
            name = f"{look}, {spp} samples{how}"
            print(f"{name if asked else f'({name})':52} {count:21.1f} {100 * count / surface:9.2f} %", flush=True)
    print(f"asked: at most {100 * MOST_SKY:.0f} %: {'met' if fine else 'missed'}")
    return fine


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--skylit", default="target/release/skylit", metavar="PROGRAM")
    p.add_argument("--only", choices=("unused", "sky"))
    p.add_argument("--json", metavar="FILE", help="a record of all runs")
    a = p.parse_args()
    version = subprocess.run([a.skylit, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    print(version.splitlines()[0])
    with tempfile.TemporaryDirectory() as folder:
        counter = Counter(os.path.abspath(a.skylit), folder)
        fine = [part(counter) for name, part in (("unused", unused), ("sky", sky)) if a.only in (None, name)]
    if a.json:
        with open(a.json, "w") as out:
            json.dump({"skylit": version, "runs": counter.runs}, out, indent=1)
    return 0 if all(fine) else 1


if __name__ == "__main__":
    sys.exit(main())
