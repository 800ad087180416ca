"""How long NVRTC takes for the kernels of the GPU renderer, by part and architecture. Needs no GPU.

    python benchmarks/compile_cuda.py [--json FILE]

Seconds of processor time of one thread, the least of a few runs: other work on the machine only adds. Parts are
compiled side by side, so that a first call waits for the longest one of its kind, if there are as many cores.
"""

import argparse
import time
from pathlib import Path

from report import environment, say, show, write_json

from diff3ds.render.cuda.compile import compile_part
from diff3ds.render.cuda.sources import DRAWING, MONTE_CARLO, PARTS

ARCHITECTURES = ("sm_75", "sm_80", "sm_90", "sm_100")
ROUNDS = 3


def seconds(part: str, arch: str) -> float:
    """Processor time of one compilation."""
    start = time.thread_time()
    compile_part(part, "float", arch)
    return time.thread_time() - start


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    about = environment()
    say("  ".join(f"{k}: {v}" for k, v in about.items()))
    # The first one loads NVRTC.
    seconds("draw", ARCHITECTURES[0])
    figures = {
        arch: {part: min(seconds(part, arch) for _ in range(ROUNDS)) for part in PARTS} for arch in ARCHITECTURES
    }
    for times in figures.values():
        times["longest, every drawing"] = max(times[part] for part in DRAWING)
        times["longest, Monte Carlo"] = max(times[part] for part in MONTE_CARLO)
    rows = [[part, *(figures[arch][part] for arch in ARCHITECTURES)] for part in figures[ARCHITECTURES[0]]]
    show("Compilation, s of processor time", ["", *ARCHITECTURES], rows)
    if chosen.json:
        write_json(chosen.json, about, figures)


if __name__ == "__main__":
    main()
