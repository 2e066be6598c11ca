#!/usr/bin/env python3
"""How far our FLIP, SSIM and PSNR are from the reference implementations, and how well the test for bias keeps its word: tables.

    python3 -m venv venv && venv/bin/pip install flip-evaluator==1.7 scikit-image==0.26.0 numpy imageio OpenEXR
    venv/bin/python tests/agreement/run.py [--write] [--only WORD] [--keep DIR] [--statistics]

Pairs are made here by formulas (fixed seeds), and, where SKYLIT_DATA (or ../shared/data) is there, taken from
it: other people's renders of the same scenes, references with noise put in, the pair of the FLIP authors. All are handed on as
8-bit PNG or as PFM, so that both sides see the same numbers. --write puts the tables into tests/README.md, between their
markers; --keep leaves the pictures in a folder. Exit code 1 if a pair is beyond the limits: 1e-4 for the mean of FLIP, 1e-6
for SSIM, and PSNR in decibels. What is told of the test for bias is the record of `cargo bench --bench statistics`, taken anew by
--statistics, which takes more than an hour of two processors.

FLIP there is the mean in f64 of flip-evaluator's own map: it sums in f32 itself, which loses digits in large pictures. SSIM
is with Gaussian weights of 1.5 pixels and covariances of the population, range 1, channels apart: Wang's settings.
"""
import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile

import flip_evaluator
import imageio.v3 as imageio
import numpy as np
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

HOME = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
DATA = os.environ.get("SKYLIT_DATA", os.path.join(HOME, "..", "shared", "data"))
RECORD = os.path.join(HOME, "benches", "records", "statistics.json")
LDR_HEADER = (
    "pair | size | FLIP | less flip-evaluator's | SSIM | less scikit-image's | PSNR, dB | less scikit-image's"
)
HDR_HEADER = "pair | size | exposures, stops | HDR-FLIP | less flip-evaluator's"
FLIP_LIMIT, SSIM_LIMIT, PSNR_LIMIT = 1e-4, 1e-6, 1e-6


def grid(w, h):
    x, y = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
    return x[..., None], y[..., None]


def scene(w=160, h=120):
    """Something like a picture: a shaded ball before a sky and a chequered floor."""
    x, y = grid(w, h)
    sky = np.concatenate([0.4 + 0.3 * y, 0.5 + 0.3 * y, 0.9 - 0.2 * y], -1)
    floor = np.where((np.floor(12 * x) + np.floor(30 * y * y)) % 2 > 0, 0.7, 0.2) * np.array([1.0, 0.9, 0.8])
    picture = np.where(y > 0.6, floor, sky)
    dx, dy = (x - 0.5) * w / h, y - 0.5
    inside = 1 - (dx * dx + dy * dy) / 0.09
    shade = np.clip(0.3 + 0.6 * np.sqrt(np.maximum(inside, 0)) - 0.5 * dx, 0, 1) * np.array([0.9, 0.35, 0.2])
    return np.where(inside > 0, shade, picture)


def letters(w=160, h=120, seed=5):
    """Edges as text has them: strokes of one to three pixels."""
    random, page = np.random.default_rng(seed), np.ones((h, w, 3))
    for _ in range(160):
        x, y = random.integers(0, w - 12), random.integers(0, h - 12)
        a, b = random.integers(1, 4), random.integers(4, 12)
        page[y : y + (a if random.random() < 0.5 else b), x : x + (b if random.random() < 0.5 else a)] = 0.05
    return page


def checker(w, h, size):
    x, y = np.meshgrid(np.arange(w), np.arange(h))
    return ((x // size + y // size) % 2)[..., None] * np.ones(3)


def blurred(p):
    padded = np.pad(p, ((1, 1), (1, 1), (0, 0)), "edge")
    rows = (padded[:-2] + padded[1:-1] + padded[2:]) / 3
    return (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]) / 3


def ldr_made():
    random = np.random.default_rng(7)
    s, page, x = scene(), letters(), grid(200, 60)[0] * np.ones(3)
    normal = random.normal(0, 1, s.shape)
    yield "gradient, gamma 1.1", x, x**1.1
    yield "gradient, 32 steps", x, np.floor(x * 32) / 32
    for amount in (0.01, 0.05, 0.2):
        yield f"scene, noise {amount}", s, s + amount * normal
    yield "noise, other noise", random.random((97, 131, 3)), random.random((97, 131, 3))
    yield "scene, shifted by a pixel", s, np.roll(s, 1, 1)
    yield "scene, mirrored", s, s[:, ::-1]
    yield "scene, times 0.9", s, s * 0.9
    yield "scene, blurred", s, blurred(s)
    yield "scene, red and blue swapped", s, s[..., ::-1]
    yield "scene, very dark", s * 0.02, s * 0.03
    yield "text, shifted by a pixel", page, np.roll(page, 1, 0)
    yield "text, blurred", page, blurred(page)
    yield "text, other text", page, letters(seed=6)
    for size in (1, 3, 16):
        yield f"checker {size}, shifted", checker(120, 90, size), np.roll(checker(120, 90, size), 1, 1)
    yield "checker, lower contrast", checker(120, 90, 8), 0.3 + 0.4 * checker(120, 90, 8)
    yield "black, white", np.zeros((40, 40, 3)), np.ones((40, 40, 3))
    yield "one gray, another", np.full((40, 40, 3), 0.5), np.full((40, 40, 3), 0.6)
    yield "equal", s, s
    yield "one pixel wide", s[:, :1], s[:, 80:81]
    yield "smaller than the filters", s[:7, :5], s[60:67, 60:65]


def hdr_made():
    random = np.random.default_rng(11)
    s = scene() ** 2.2
    sun = s.copy()
    sun[12:18, 20:26] = 4e4
    rough = np.exp(random.normal(0, 1.5, (90, 120, 3)))
    wide = 10 ** (grid(240, 60)[0] * 7 - 3) * np.array([1.0, 0.8, 0.6])
    rendered = lambda p, n: p * random.gamma(n, 1 / n, p.shape)
    fireflies = s.copy()
    fireflies[random.random(s.shape[:2]) < 0.002] = 300
    yield "scene, times 1.1", s, s * 1.1
    yield "scene, times 1/pi", s, s / math.pi
    yield "scene, shifted by a pixel", s, np.roll(s, 1, 1)
    yield "scene, 4 samples", s, rendered(s, 4)
    yield "scene, 256 samples", s, rendered(s, 256)
    yield "scene, fireflies", s, fireflies
    yield "scene, fireflies in the reference", fireflies, s
    yield "sun, shifted by a pixel", sun, np.roll(sun, 1, 0)
    yield "sun, half as bright", sun, np.where(sun > 100, sun / 2, sun)
    yield "sun, none", sun, s
    yield "sun, 16 samples", sun, rendered(sun, 16)
    yield "log-normal, noise", rough, rough * np.exp(random.normal(0, 0.2, rough.shape))
    yield "log-normal, other", rough, np.exp(random.normal(0, 1.5, rough.shape))
    yield "seven decades, times 1.2", wide, wide * 1.2
    yield "seven decades, plus 0.01", wide, wide + 0.01
    yield "text, 100 times brighter", 100 * letters(), 100 * np.roll(letters(), 1, 1)
    yield "checker of 0.1 and 50", 0.1 + 49.9 * checker(120, 90, 6), 0.1 + 40 * checker(120, 90, 6)
    yield "negative values", s, np.where(random.random(s.shape) < 0.1, -0.2 * s, s)
    yield "mostly black", np.where(grid(160, 120)[1] < 0.6, 0, s), s
    yield "constant", np.ones((40, 40, 3)), np.full((40, 40, 3), 1.5)
    yield "equal", sun, sun
    yield "one pixel wide", s[:, :1], s[:, 80:81]


def read(path):
    if not path.endswith(".exr"):
        return imageio.imread(path)[..., :3] / np.float32(255)
    import OpenEXR

    channels = OpenEXR.File(path, separate_channels=True).channels()
    return np.stack([channels[c].pixels.astype(np.float32) for c in "RGB"], -1)


def ldr_found():
    tree = os.path.join(DATA, "images", "flip")
    if not os.path.isdir(tree):
        return
    yield "the FLIP pair", *(read(os.path.join(tree, f"tree-{n}.png")) for n in ("ref", "test"))
    a, b = (os.path.join(DATA, "images", f"cse168-{n}") for n in ("abhinandansharma1999", "TobeyPineda"))
    for name in sorted(set(os.listdir(a)) & set(os.listdir(b))):
        first, second = read(os.path.join(a, name)), read(os.path.join(b, name))
        if first.shape == second.shape:
            yield f"course, {name[:-4]}", first, second


def hdr_found():
    random = np.random.default_rng(13)
    for root, _, names in sorted(os.walk(DATA)):
        if os.path.relpath(root, DATA).split(os.sep)[0] not in ("scenes", "images"):
            continue
        for name in sorted(names):
            if not name.endswith(".exr"):
                continue
            try:
                picture = np.maximum(read(os.path.join(root, name)), 0)
            except KeyError:
                continue  # Not colours.
            noisy = picture * random.gamma(16, 1 / 16, picture.shape)
            yield f"{os.path.relpath(os.path.join(root, name), DATA)}, noise", picture, noisy


def write_pfm(path, p):
    with open(path, "wb") as f:
        f.write(b"PF\n%d %d\n-1.0\n" % (p.shape[1], p.shape[0]))
        f.write(np.ascontiguousarray(p[::-1], "<f4").tobytes())


def ours(paths):
    """What we say of a pair of files: figures by metric, with words on how they were taken."""
    program = os.path.join(HOME, "target", "release", "skylit")
    command = [program, "compare", *paths, "--metric", "flip,hdr-flip,ssim,psnr", "--json", "-", "--quiet"]
    record = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    figures = record["comparisons"][0]["figures"]
    return {f["metric"]: f["value"] for f in figures}, {f["metric"]: f.get("note", "") for f in figures}


def evaluator(kind, a, b):
    """The mean of flip-evaluator's map, and its parameters."""
    found, _, settings = flip_evaluator.evaluate(a, b, kind.upper(), applyMagma=False, computeMeanError=False)
    return float(found.astype(np.float64).mean()), settings


def number(v, digits):
    return "" if v is None else f"{v:.{digits}f}"


def row_ldr(folder, i, name, a, b):
    a, b = (np.round(np.clip(p, 0, 1) * 255).astype(np.uint8) for p in (a, b))
    paths = [os.path.join(folder, f"ldr-{i}-{n}.png") for n in ("ref", "test")]
    for path, p in zip(paths, (a, b)):
        imageio.imwrite(path, p)
    here, _ = ours(paths)
    a, b = (p.astype(np.float32) / np.float32(255) for p in (a, b))
    there = {"flip": evaluator("ldr", a, b)[0], "ssim": None, "psnr": None}
    a, b = a.astype(np.float64), b.astype(np.float64)
    if min(a.shape[:2]) >= 11:
        there["ssim"] = structural_similarity(
            a, b, data_range=1.0, channel_axis=-1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
        )
    if (a != b).any():
        there["psnr"] = peak_signal_noise_ratio(a, b, data_range=1.0)
    cells, good = [], True
    for key, limit, digits in (("flip", FLIP_LIMIT, 6), ("ssim", SSIM_LIMIT, 7), ("psnr", PSNR_LIMIT, 4)):
        difference = None if there[key] is None else here[key] - there[key]
        good &= (here[key] is None) == (there[key] is None) and (difference is None or abs(difference) <= limit)
        cells += [number(here[key], digits), "" if difference is None else f"{difference:+.1e}"]
    return f"| {name} | {a.shape[1]}x{a.shape[0]} | {' | '.join(cells)} |", good


def row_hdr(folder, i, name, a, b):
    a, b = a.astype(np.float32), b.astype(np.float32)
    paths = [os.path.join(folder, f"hdr-{i}-{n}.pfm") for n in ("ref", "test")]
    for path, p in zip(paths, (a, b)):
        write_pfm(path, p)
    here, notes = ours(paths)
    there, settings = evaluator("hdr", a, b)
    difference = here["hdr-flip"] - there
    count, start, stop = re.match(r"(\d+) exposures from (\S+) to (\S+) stops", notes["hdr-flip"]).groups()
    counts = int(count), settings["numExposures"]
    good = abs(difference) <= FLIP_LIMIT and counts[0] == counts[1]
    exposures = f"{start} to {stop}, {count}"
    return f"| {name} | {a.shape[1]}x{a.shape[0]} | {exposures} | {here['hdr-flip']:.6f} | {difference:+.1e} |", good


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--keep")
    parser.add_argument("--statistics", action="store_true")
    options = parser.parse_args()
    subprocess.run(["cargo", "build", "--quiet", "--release"], cwd=HOME, check=True)
    lines, misses, counts = [], [], []
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or temporary
        os.makedirs(folder, exist_ok=True)
        for header, sources, row in (
            (LDR_HEADER, (ldr_made, ldr_found), row_ldr),
            (HDR_HEADER, (hdr_made, hdr_found), row_hdr),
        ):
            names = header.split(" | ")
            lines += ["| " + header + " |", "|---|---|" + "---:|" * (len(names) - 2)]
            print("\n".join(lines[-2:]))
            pairs = [p for source in sources for p in source() if options.only in p[0]]
            for i, (name, a, b) in enumerate(pairs):
                line, good = row(folder, i, name, a, b)
                lines.append(line)
                print(line, flush=True)
                misses += [] if good else [name]
            counts.append(len(pairs))
            lines.append("")
    summary = f"{counts[0]} displayed pairs and {counts[1]} of radiance: " + (
        "all within the limits." if not misses else f"beyond the limits: {'; '.join(misses)}."
    )
    print(summary)
    if options.write:
        write("agreement", summary + "\n\n" + "\n".join(lines).rstrip())
    if options.statistics:
        # It writes its record whatever comes out, and that is told below.
        subprocess.run(["cargo", "bench", "--quiet", "--bench", "statistics", "--", "--json", RECORD], cwd=HOME)
    with open(RECORD) as f:
        told, kept = statistics(json.load(f))
    print("\n" + told)
    if options.write:
        write("statistics", told)
    return 1 if misses or not kept else 0


def write(part, text):
    """Puts a text between its markers."""
    path = os.path.join(HOME, "tests", "README.md")
    begin, end = f"<!-- {part}: begin -->", f"<!-- {part}: end -->"
    before, rest = open(path).read().split(begin, 1)
    after = rest.split(end, 1)[1]
    with open(path, "w") as f:
        f.write(f"{before}{begin}\n{text}\n{end}{after}")


def table(header, rows):
    names = header.split(" | ")
    lines = ["| " + header + " |", "|---|" + "---:|" * (len(names) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def statistics(record):
    """The record of the test for bias as tables, and whether every promise was kept."""
    percent = lambda part, whole, digits=2: f"{100 * part / whole:.{digits}f} %"
    named = lambda case, passes: case.split(" ", 1)[1] + ("" if passes else " **miss**")
    rates = [
        [
            named(r["case"], r["passes"]),
            "{}, {}".format(*r["spp"]),
            str(r["pairs"]),
            percent(r["different"], r["pairs"]),
            f"{r['binomial_p']:.2f}",
            "1 %" if r["exact"] else "at most 1 %",
            percent(r["tiles_below"][1], 1),
        ]
        for r in record["rates"]
    ]
    powers = [
        [
            named(p["case"], p["passes"]),
            "{}x{}".format(*p["size"]),
            str(p["pixels"]),
            str(p["pairs"]),
            percent(p["found"], p["pairs"], 0),
            percent(p["different"], p["pairs"], 0),
            "-" if p["promised"] is None else percent(p["promised"], 1),
        ]
        for p in record["powers"]
    ]
    margins = [
        [
            named(m["case"], m["passes"]),
            f"{m['apart']:g}",
            str(m["pairs"]),
            percent(m["equivalent"], m["pairs"], 1),
            percent(m["different"], m["pairs"], 1),
        ]
        for m in record["margins"]
    ]
    parts = [
        "Pairs that differ in their noise alone, called different at 1 %:",
        table("pairs | samples | number | different | binomial p | should be | tiles at 1 %", rates),
        "One material 0.5 % brighter, or of a hue that leaves luminance as it is, at 64 samples a pixel:",
        table("pairs | size | its pixels | number | object found | different | promised to find", powers),
        "Asked for equivalence, pairs that are so many margins apart, 32 samples a pixel:",
        table("pairs, margin | apart | number | equivalent | different", margins),
    ]
    everything = record["rates"] + record["powers"] + record["margins"]
    return "\n\n".join(parts), all(row["passes"] for row in everything)


if __name__ == "__main__":
    sys.exit(main())
