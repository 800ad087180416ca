"""Speed and memory of `diff3ds.render` on an NVIDIA GPU: run by `python benchmarks/render.py --device cuda`.

"device" is the time of a replayed CUDA graph between two events: what the kernels take. "user" is the time of a call
and a wait, graphs off; "one thread" the same with the backward pass in the caller's thread, not in one that autograd
wakes for a GPU. "must move" are the bytes of images, upstream gradients and strokes, and "floor" is the time
that the memory needs for them, at the speed of a large copy.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch
from report import environment, say, show, write_json
from workloads import WORKLOADS, Workload, leaves, scene

import diff3ds as ds

GPU_WORKLOADS = {name: WORKLOADS[name] for name in "ABD"} | {"E": Workload(100_000, 1, (4096, 4096))}
ROUNDS, WARM_UP = 50, 5
# The largest drawings have fewer rounds: no more begin after so many seconds, but for the first ones.
LONGEST, LEAST_ROUNDS = 4.0, 5
# Aims in ms: by workload and figure; seconds of a first call, and of a later process.
AIMS = {
    ("A", "both, device"): 0.25,
    ("A", "both, user"): 0.4,
    ("B", "both, device"): 0.8,
    ("D", "forward, device"): 0.6,
    ("D", "backward, device"): 1.0,
}
FIRST_CALL, LATER_PROCESS = 2.0, 0.1
FIRST = """
import time, torch, diff3ds as ds
sketch = ds.Sketch.random(56, generator=torch.Generator().manual_seed(0)).to("cuda")
cameras = ds.orbit([0.0, 90.0], size=256).to("cuda")
torch.zeros(1, device="cuda").square().sum().item()
start = time.perf_counter()
ds.render(sketch, cameras, backend="cuda").color.sum().item()
print(time.perf_counter() - start)
"""


class Passes:
    """Forward, backward and both of one workload on the device."""

    def __init__(self, workload: Workload) -> None:
        sketch, cameras = scene(workload)
        self.sketch, self.cameras = sketch.to("cuda"), cameras.to("cuda")
        self.leaf, self.tensors = leaves(self.sketch)
        shape = (workload.views, *workload.size, 3)
        self.upstream = torch.randn(shape, generator=torch.Generator().manual_seed(1)).cuda()

    def forward(self) -> torch.Tensor:
        """Without gradients."""
        return ds.render(self.sketch, self.cameras, backend="cuda").color

    def both(self) -> tuple[torch.Tensor, ...]:
        """Forward with what the backward needs, and backward."""
        color = ds.render(self.leaf, self.cameras, backend="cuda").color
        return torch.autograd.grad(color, self.tensors, self.upstream)

    def kept_forward(self) -> torch.Tensor:
        """Forward with what the backward needs."""
        return ds.render(self.leaf, self.cameras, backend="cuda").color


def device_ms(way: Callable[[], object]) -> float:
    """Median time of a replayed graph."""
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(WARM_UP):
            way()
    torch.cuda.current_stream().wait_stream(stream)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        # Kept alive: its memory belongs to the graph.
        kept = way()
    times: list[float] = []
    for _ in _rounds():
        start, stop = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        start.record()
        graph.replay()
        stop.record()
        stop.synchronize()
        times.append(start.elapsed_time(stop))
    del kept
    return statistics.median(times)


def user_ms(way: Callable[[], object]) -> float:
    """Median time of a call and a wait."""
    for _ in range(WARM_UP):
        way()
    torch.cuda.synchronize()
    times: list[float] = []
    for _ in _rounds():
        start = time.perf_counter()
        way()
        torch.cuda.synchronize()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def _rounds() -> Iterator[int]:
    begun = time.perf_counter()
    for k in range(ROUNDS):
        if k >= LEAST_ROUNDS and time.perf_counter() - begun > LONGEST:
            return
        yield k


def copy_speed() -> float:
    """Bytes a ms of a large copy, reading and writing."""
    a = torch.empty(1 << 28, dtype=torch.float32, device="cuda")
    b = torch.empty_like(a)
    return 2 * a.nbytes / device_ms(lambda: b.copy_(a))


def must_move(workload: Workload) -> dict[str, int]:
    """Bytes of each pass: colour, alpha and depth out, the gradient of colour in; strokes in, their gradients out."""
    pixels = workload.views * workload.size[0] * workload.size[1]
    strokes = workload.strokes * 4 * (12 + 4 + 1 + 3 + 1)
    forward, backward = 20 * pixels + strokes, 12 * pixels + 2 * strokes
    return {"forward": forward, "backward": backward, "both": forward + backward}


def measure(workload: Workload) -> dict[str, float | None]:
    """Figures of one workload, ms and MB."""
    torch.cuda.empty_cache()
    passes = Passes(workload)
    passes.both()
    torch.cuda.synchronize()
    torch.cuda.reset_peak_memory_stats()
    before = torch.cuda.memory_allocated()
    passes.both()
    torch.cuda.synchronize()
    figures: dict[str, float | None] = {"memory, MB": (torch.cuda.max_memory_allocated() - before) / 1e6}
    for name, way in (("forward", passes.forward), ("kept", passes.kept_forward), ("both", passes.both)):
        figures[f"{name}, device"], figures[f"{name}, user"] = device_ms(way), user_ms(way)
    # Without the thread that autograd has for a GPU.
    with torch.autograd.set_multithreading_enabled(False):
        figures["both, one thread"] = user_ms(passes.both)
    for clock in ("device", "user"):
        figures[f"backward, {clock}"] = float(figures[f"both, {clock}"] or 0) - float(
            figures.pop(f"kept, {clock}") or 0
        )
    return figures


def beside(workload: Workload) -> dict[str, float]:
    """Forward with backward by the reference on the device, and by the kernels on the CPU: ms of one warm call."""
    sketch, cameras = scene(workload)
    result = {}
    for name, device in (("reference", "cuda"), ("cpu", "cpu")):
        leaf, tensors = leaves(sketch.to(device))
        views, upstream = cameras.to(device), torch.ones(workload.views, *workload.size, 3, device=device)

        def both(
            name: str = name, leaf: ds.Sketch = leaf, tensors: Any = tensors, views: Any = views, up: Any = upstream
        ) -> None:
            torch.autograd.grad(ds.render(leaf, views, backend=name).color, tensors, up)

        both()
        torch.cuda.synchronize()
        start = time.perf_counter()
        both()
        torch.cuda.synchronize()
        result[name] = 1e3 * (time.perf_counter() - start)
    return result


def first_calls() -> dict[str, float]:
    """Seconds of the first call: with nothing compiled, and in a later process."""
    with tempfile.TemporaryDirectory() as folder:
        run = [sys.executable, "-c", FIRST]
        setting = {**os.environ, "XDG_CACHE_HOME": folder}
        seconds = [float(subprocess.check_output(run, env=setting, text=True)) for _ in range(2)]
    return {"first call, s": seconds[0], "later process, s": seconds[1]}


def main(names: str, quick: bool, json: Path | None) -> None:
    """Measures and prints; `names` are letters of GPU_WORKLOADS."""
    about = environment() | {"gpu": torch.cuda.get_device_name(), "cuda": torch.version.cuda}
    say("  ".join(f"{k}: {v}" for k, v in about.items()))
    bytes_a_ms = copy_speed()
    say(f"copy: {bytes_a_ms / 1e9:.2f} TB/s")
    figures: dict[str, Any] = {"copy, TB/s": bytes_a_ms / 1e9, "first": first_calls(), "workloads": {}}
    for name in names:
        workload = GPU_WORKLOADS[name]
        found: dict[str, Any] = measure(workload)
        for way, size in must_move(workload).items():
            found[f"{way}, bytes"], found[f"{way}, floor"] = size, size / bytes_a_ms
        if not quick and workload.strokes <= 2048:
            found |= beside(workload)
        figures["workloads"][name] = found
        rows = [
            [p, *(found[f"{p}, {c}"] for c in ("device", "user", "floor")), found[f"{p}, bytes"] / 1e6]
            for p in ("forward", "backward", "both")
        ]
        show(f"{name}: {workload}", ["", "device, ms", "user, ms", "floor, ms", "must move, MB"], rows)
        say(f"both, backward in the caller's thread, ms: {found['both, one thread']:.4g}")
        say("  ".join(f"{k}: {found[k]:.4g}" for k in ("memory, MB", "reference", "cpu") if k in found))
    aims = [(f"{n} {what}", figures["workloads"][n][what], bound) for (n, what), bound in AIMS.items() if n in names]
    aims += [(k, v, b) for (k, v), b in zip(figures["first"].items(), (FIRST_CALL, LATER_PROCESS), strict=True)]
    show("Aims", ["", "figure", "bound", "met"], [[*row, "yes" if row[1] <= row[2] else "NO"] for row in aims])
    if json:
        write_json(json, about, figures)
