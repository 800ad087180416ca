"""Accuracy of the renderer: kernels against reference, gradients against differences, Monte Carlo against samples.

    python benchmarks/accuracy.py [--quick] [--only kernels,gradients,montecarlo] [--json FILE]

Some five minutes on one core; --quick takes one.
"""

import argparse
from pathlib import Path

import accuracy_gradients
import accuracy_kernels
import accuracy_montecarlo
import torch
from report import environment, say, write_json

PARTS = ("kernels", "gradients", "montecarlo")


def main() -> None:
    """Compares and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer scenes and samples")
    parser.add_argument("--only", default=",".join(PARTS), help=f"parts to run, of {', '.join(PARTS)}")
    parser.add_argument("--json", type=Path, help="file for the figures")
    chosen = parser.parse_args()
    parts = chosen.only.split(",")
    if set(parts) - set(PARTS):
        parser.error(f"--only takes {', '.join(PARTS)}, got {chosen.only!r}")
    about = environment()
    say("  ".join(f"{k}: {v}" for k, v in about.items()))
    # Nothing here is timed, and torch's own sums then repeat bit for bit.
    torch.set_num_threads(1)
    figures = {}
    if "kernels" in parts:
        figures["kernels"] = accuracy_kernels.run(scenes=30 if chosen.quick else 200)
    if "gradients" in parts:
        figures["gradients"] = accuracy_gradients.run(scenes=3 if chosen.quick else 12, directions=2)
    if "montecarlo" in parts:
        figures["montecarlo"] = accuracy_montecarlo.run(("image",) if chosen.quick else ("image", "world"))
    if chosen.json:
        write_json(chosen.json, about, figures)


if __name__ == "__main__":
    main()
