"""How far a picture is from the truth, and the record of it: the same as skylit's src/bench/error has.

Every renderer is measured against its own converged reference, so that what two renderers mean differently (a sky's
interpolation, a lobe's tails) is nobody's error.
"""
import json
import os
import sys

import numpy as np

from files import read_exr, rgb, write_exr

FORMAT = "skylit bench error 1"
# Part of the squared mean luminance that is added to the squared reference in `relmse`.
EPSILON = 0.01
# A pixel is one of a surface where the reference's alpha is at least this.
COVERED = 0.99
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


class Reference:
    """The truth r = (a + b) / 2 from two independent halves; ((a - b) / 2)^2 is an unbiased estimate of r's variance."""

    def __init__(self, color, variance, alpha, spp):
        self.color, self.variance, self.spp = color.astype(np.float64), variance.astype(np.float64), spp
        self.surfaces = alpha >= COVERED
        self.alpha = alpha
        self.luminance = float((self.color @ WEIGHTS).mean())

    @classmethod
    def of_halves(cls, a, b, alpha, spp):
        return cls((a + b) / 2, ((a - b) / 2) ** 2, alpha, spp)

    @classmethod
    def load(cls, path):
        planes, header = read_exr(path)
        variance = np.stack([planes[f"variance.{c}"] for c in "RGB"], -1)
        return cls(rgb(planes), variance, planes["A"], int(header["spp"]))

    def save(self, path):
        """In the form of `skylit render --aov variance`."""
        planes = {c: self.color[..., i] for i, c in enumerate("RGB")} | {"A": self.alpha}
        planes |= {f"variance.{c}": self.variance[..., i] for i, c in enumerate("RGB")}
        write_exr(path, planes, {"spp": str(self.spp)})

    def means(self, squares):
        """`mse` and `relmse` of squared differences, for each set of pixels."""
        scale = self.color**2 + EPSILON * self.luminance**2
        # Where all is black, what does not differ is right.
        relative = np.divide(squares, scale, out=np.zeros_like(squares), where=squares > 0)
        mean = lambda x, mask: float(x[mask].mean()) if mask.any() else 0.0
        sets = {"all": np.ones_like(self.surfaces), "surfaces": self.surfaces}
        return {k: {"mse": mean(squares, m), "relmse": mean(relative, m)} for k, m in sets.items()}

    def errors(self, x):
        d = x.astype(np.float64) - self.color
        out = self.means(d**2)
        bias = d @ WEIGHTS
        out["all"]["bias"] = float(bias.mean())
        out["surfaces"]["bias"] = float(bias[self.surfaces].mean()) if self.surfaces.any() else 0.0
        return out

    def record(self):
        return {
            "spp": self.spp,
            "luminance": self.luminance,
            "surfaces": float(self.surfaces.mean()),
            "noise": self.means(self.variance),
        }


def cpu():
    try:
        with open("/proc/cpuinfo") as f:
            return next(line.split(":", 1)[1].strip() for line in f if line.startswith("model name"))
    except (OSError, StopIteration):
        return "unknown"


def words(argv):
    """A command's words, without the folders of one machine: records are published."""
    return [os.path.basename(w.rstrip("/")) if os.path.isabs(w) else w for w in argv]


def write_record(path, program, threads, scenes):
    record = {
        "format": FORMAT,
        "program": program,
        "command": ["python3", *words(sys.argv)],
        "machine": {"cpu": cpu(), "threads": threads},
        "scenes": scenes,
    }
    with open(path + ".part", "w") as f:
        json.dump(record, f, indent=1)
        f.write("\n")
    os.replace(path + ".part", path)
