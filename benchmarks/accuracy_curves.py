"""Closest points of random and degenerate curves against dense sampling: misses and worst excess, by family.

Run with: python benchmarks/accuracy_curves.py --cases 100000
"""

import argparse
import sys
import time
from pathlib import Path

import torch

from diff3ds import bezier

# The families and the sampling are those of the tests.
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from curve_cases import FAMILIES, Cases, sampled_distance

# Cases sampled at a time: some 800 samples of each, 100 MB.
CHUNK = 1000


def measure(cases: Cases) -> tuple[torch.Tensor, float]:
    """Excess of each distance over the sampled one as a share of what is allowed, and microseconds a closest point."""
    start = time.perf_counter()
    found = bezier.closest_point(*cases).distance[:, 0]
    elapsed = time.perf_counter() - start
    true = torch.cat([sampled_distance(Cases(*part)) for part in zip(*(v.split(CHUNK) for v in cases), strict=True)])
    return (found - true) / cases.tolerance, 1e6 * elapsed / len(found)


def main() -> None:
    """Prints one row a family."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000, help="cases in all, spread evenly over the families")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    count = -(-options.cases // len(FAMILIES))
    print("A miss is farther than dense sampling by over 1e-9 of the curve's size (and the rounding of coordinates).")
    print("The excess is relative to that size; 'beaten' counts where sampling was farther by more than that.")
    print(f"{'family':20} {'cases':>7} {'misses':>7} {'worst excess':>13} {'beaten':>7} {'us each':>8}")
    total = 0
    for family in FAMILIES:
        generator = torch.Generator().manual_seed(options.seed)
        share, microseconds = measure(family(generator, count))
        misses, beaten = int((share > 1).sum()), int((share < -1).sum())
        worst = max(float(share.max()), 0.0) * 1e-9
        print(f"{family.__name__:20} {count:7} {misses:7} {worst:13.1e} {beaten:7} {microseconds:8.1f}", flush=True)
        total += misses
    print(f"{'all':20} {count * len(FAMILIES):7} {total:7}")
    sys.exit(total > 0)


if __name__ == "__main__":
    main()
