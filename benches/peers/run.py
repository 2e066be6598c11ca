#!/usr/bin/env python3
"""Everything: error against time of skylit and its peers on the scenes of scenes.py, and the tables and plots of them.

    python3 benches/peers/run.py DIR --json OUTDIR [--peers skylit,mitsuba,mitsuba-scalar,cycles,lux] [--scenes NAME,...] [options]

Each renderer runs in a process of its own, one after the other, and writes OUTDIR/NAME.json; then all records that stand
in OUTDIR are drawn as OUTDIR/all.html and all.txt, a plot of each scene as SCENE.svg. Where one fails, the others go on.
Where one of --spp, --replicates and --reference-spp is not given, each renderer takes what is good for it (see LADDERS):
half an hour or so for eight scenes, where references are kept. They are in DIR/references. --threads and --size are handed
on as they are.
With --keep, renderers whose record OUTDIR has already are not measured again, so that a run goes on with the one at which it
was stopped: records bear their name once they are whole (till then NAME.json.part).

Peers that need another Python than this one: --python cycles=PROGRAM, as often as needed.
"""
import argparse
import json
import os
import subprocess
import sys

HOME = os.path.dirname(os.path.abspath(__file__))
# Names of records, with the words of their commands.
PEERS = {
    "skylit": [["skylit"]],
    "mitsuba": [["mitsuba-llvm", "peer_mitsuba.py"]],
    "mitsuba-scalar": [["mitsuba-scalar", "peer_mitsuba.py", "--variant", "scalar_rgb"]],
    "cycles": [["cycles", "peer_cycles.py"]],
    "lux": [["lux", "peer_lux.py"]],
}
# Samples a pixel, runs of each, and samples of references: slow ones take fewer, as far as errors of 5 to 1 % need.
LADDERS = {
    "skylit": ("1,4,16,64", 8, 1024),
    "mitsuba": ("1,4,16,64,256", 4, 4096),
    "mitsuba-scalar": ("1,4,16", 3, 256),
    "cycles": ("1,4,16,64", 3, 512),
    "lux": ("4,16,64", 2, 512),
}


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("dir")
    p.add_argument("--json", required=True, metavar="OUTDIR")
    p.add_argument("--peers", default=",".join(PEERS))
    p.add_argument("--scenes", help="default: all that are in DIR")
    p.add_argument("--skylit", default="target/release/skylit", metavar="PROGRAM")
    p.add_argument("--keep", action="store_true", help="leave records that stand in OUTDIR as they are")
    p.add_argument("--python", action="append", default=[], metavar="PEER=PROGRAM")
    a, rest = p.parse_known_args()
    for name in a.peers.split(","):
        if name not in PEERS:
            p.error(f"unknown peer {name}; known: {', '.join(PEERS)}")
    return a, rest


def ladder(peer, rest):
    """What is not among the options that were given."""
    given = {word.split("=")[0] for word in rest}
    usual = zip(("--spp", "--replicates", "--reference-spp"), LADDERS[peer])
    return [str(word) for option in usual if option[0] not in given for word in option]


def all_scenes(folder):
    return sorted(n[:-5] for n in os.listdir(folder) if n.endswith(".json"))


def draw(a):
    """Pages of all records that there are, skylit's first; a plot for each scene of that."""
    path = lambda name: os.path.join(a.json, name)
    kept = [path(f"{r}.json") for words in PEERS.values() for r, *_ in words if os.path.exists(path(f"{r}.json"))]
    if not kept:
        return
    others = [w for record in kept[1:] for w in ("--with", record)]
    with open(path("all.txt"), "w") as out:
        subprocess.run([a.skylit, "bench", "error", kept[0], *others, "--html", path("all.html")], stdout=out)
    with open(kept[0]) as f:
        record = json.load(f)
    for scene in record["scenes"]:
        one = path(f".{scene['name']}.json")
        with open(one, "w") as f:
            json.dump({**record, "scenes": [scene]}, f)
        svg = ["--svg", path(f"{scene['name']}.svg")]
        subprocess.run([a.skylit, "bench", "error", one, *others, *svg], stdout=subprocess.DEVNULL)
        os.remove(one)


def main():
    a, rest = arguments()
    os.makedirs(a.json, exist_ok=True)
    pythons = dict(text.split("=", 1) for text in a.python)
    names = a.scenes.split(",") if a.scenes else []
    failed = []
    for peer in a.peers.split(","):
        for record, *script in PEERS[peer]:
            path = os.path.join(a.json, f"{record}.json")
            if a.keep and os.path.exists(path):
                continue
            part = f"{path}.part"
            out = ["--json", part, *ladder(peer, rest)]
            if peer == "skylit":
                files = [os.path.join(a.dir, f"{name}.toml") for name in names or all_scenes(a.dir)]
                kept = ["--references", os.path.join(a.dir, "references")]
                words = [a.skylit, "bench", "error", *files, *kept, *out, *rest]
            else:
                python = pythons.get(peer, sys.executable)
                words = [python, os.path.join(HOME, script[0]), a.dir, *names, *out, *script[1:], *rest]
            print(f"{record}:", file=sys.stderr)
            if subprocess.run(words, stdout=subprocess.DEVNULL).returncode == 0 and os.path.exists(part):
                os.replace(part, path)
            else:
                failed.append(record)
    draw(a)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
