"""One forward and one backward pass for a profiler with hardware counters (docs/explanation/gpu.md).

    ncu --profile-from-start off --set full -o A python benchmarks/profile_cuda.py A
    ncu --import A.ncu-rep

A workload of benchmarks/render_cuda.py, warm: compiled, its memory known, nothing waits. Only kernels between the
profiler's start and stop are counted: those of csrc/cuda by their names, and some of torch, which clear memory and
change types.
"""

import argparse

import torch
from render_cuda import GPU_WORKLOADS, WARM_UP, Passes


def profile(passes: Passes) -> None:
    """Runs forward and backward until they are warm, and once more for the profiler."""
    for _ in range(WARM_UP):
        passes.both()
    torch.cuda.synchronize()
    torch.cuda.profiler.start()
    passes.both()
    torch.cuda.synchronize()
    torch.cuda.profiler.stop()


def main() -> None:
    """Profiles the workload that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("workload", choices=GPU_WORKLOADS, nargs="?", default="A")
    profile(Passes(GPU_WORKLOADS[parser.parse_args().workload]))


if __name__ == "__main__":
    main()
