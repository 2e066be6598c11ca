#!/usr/bin/env python3
"""Everything: each peer's error against time on the scenes of scenes.py.

    python3 benches/peers/run.py DIR --json OUTDIR [--peers mitsuba,cycles,lux] [--scenes NAME,...] [options]

Each peer runs in a process of its own, one after the other, and writes OUTDIR/PEER.json; `skylit bench error SCENE ...
--with OUTDIR/PEER.json` draws them. Where one fails, the others go on. Other options (--spp, --replicates,
--reference-spp, --threads, --size) are handed on as they are. References are kept in DIR/references.

Peers that need another Python than this one: --python cycles=PROGRAM, as often as needed.
"""
import argparse
import os
import subprocess
import sys

HOME = os.path.dirname(os.path.abspath(__file__))
# Names of records, with the words of their commands.
PEERS = {
    "mitsuba": [["mitsuba-llvm", "peer_mitsuba.py"], ["mitsuba-scalar", "peer_mitsuba.py", "--variant", "scalar_rgb"]],
    "cycles": [["cycles", "peer_cycles.py"]],
    "lux": [["lux", "peer_lux.py"]],
}


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("dir")
    p.add_argument("--json", required=True, metavar="OUTDIR")
    p.add_argument("--peers", default=",".join(PEERS))
    p.add_argument("--scenes", help="default: all that are in DIR")
    p.add_argument("--python", action="append", default=[], metavar="PEER=PROGRAM")
    a, rest = p.parse_known_args()
    for name in a.peers.split(","):
        if name not in PEERS:
            p.error(f"unknown peer {name}; known: {', '.join(PEERS)}")
    return a, rest


def main():
    a, rest = arguments()
    os.makedirs(a.json, exist_ok=True)
    pythons = dict(text.split("=", 1) for text in a.python)
    names = a.scenes.split(",") if a.scenes else []
    failed = []
    for peer in a.peers.split(","):
        for record, script, *more in PEERS[peer]:
            python = pythons.get(peer, sys.executable)
            out = ["--json", os.path.join(a.json, f"{record}.json")]
            words = [python, os.path.join(HOME, script), a.dir, *names, *out, *more, *rest]
            print(f"{record}:", file=sys.stderr)
            if subprocess.run(words).returncode != 0:
                failed.append(record)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
