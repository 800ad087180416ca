"""Peak memory of a forward and backward pass above its images, measured in a process of its own."""

import gc
import resource
import subprocess
import sys
from pathlib import Path

import torch
from workloads import Workload, leaves, scene

import diff3ds as ds

MB = 1e6


def peak_memory(workload: Workload) -> float:
    """MB above colour, alpha and depth, their upstream gradient and the scene; one thread."""
    arguments = [workload.strokes, workload.views, *workload.size]
    command = [sys.executable, __file__, *map(str, arguments)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def _measure(workload: Workload) -> float:
    torch.set_num_threads(1)
    # What a first call loads for good is not what the workload needs.
    _pass(*scene(Workload(16, 1, (32, 32))))
    sketch, cameras = scene(workload)
    upstream = torch.ones(workload.views, *workload.size, 3)
    gc.collect()
    before = _reset_peak()
    images = _pass(sketch, cameras, upstream)
    return (_peak() - before - images) / MB


def _pass(sketch: ds.Sketch, cameras: ds.Cameras, upstream: torch.Tensor | None = None) -> int:
    """Forward and backward; bytes of the images."""
    leaf, tensors = leaves(sketch)
    image = ds.render(leaf, cameras)
    torch.autograd.grad(image.color, tensors, torch.ones_like(image.color) if upstream is None else upstream)
    return sum(t.nbytes for t in (image.color, image.alpha, image.depth))


def _reset_peak() -> float:
    """Bytes resident now; forgets earlier peaks where the system can (Linux)."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return _peak()
    return _status("VmRSS")


def _peak() -> float:
    if Path("/proc/self/status").exists():
        return _status("VmHWM")
    # In bytes on macOS, in kB elsewhere.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _status(field: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(float(line.split()[1]) for line in lines if line.startswith(field))


if __name__ == "__main__":
    strokes, views, height, width = map(int, sys.argv[1:])
    print(_measure(Workload(strokes, views, (height, width))))
