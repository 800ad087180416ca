"""Speed and memory of `diff3ds.render`: forward, and forward with backward, next to floor, reference and prototype.

    python benchmarks/render.py [--quick] [--only AB] [--prototype FOLDER] [--json FILE] [--device cuda]

Backward is the gradient of sum(color * upstream), upstream standard normal and fixed, with respect to all five tensors
of the sketch. "copy" is the floor: a copy of colour, alpha and depth to memory that is there already. On a GPU:
render_cuda.py.
"""

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import render_cuda
import torch
from memory import peak_memory
from report import environment, say, show, write_json
from timing import Times, interleaved, milliseconds
from workloads import WORKLOADS, Workload, leaves, scene

import diff3ds as ds

Ways = dict[str, Callable[[], object]]
THREADS = (1, 2)
# Share of the pixels that may differ by more than .01 from the prototype's picture: other rules at the ends of strokes.
SAME_PICTURE = 0.01
# Aims: times relative to the prototype's (C: and this many ms), of two threads to one, of Monte Carlo to analytic; MB.
MAX_PROTOTYPE, EXTRA_C, MIN_SPEEDUP, MAX_MONTECARLO = 1.2, 0.3, 1.6, 15
MAX_MEMORY = {"A": 64, "B": 512}
GROWTH = {
    "strokes": [Workload(n, 1, (512, 512)) for n in (16, 64, 256, 1024, 4096, 16384)],
    "pixels": [Workload(56, 1, (n, n)) for n in (64, 128, 256, 512, 1024, 2048, 4096)],
    "views": [Workload(56, n, (256, 256)) for n in (1, 2, 4, 8, 16, 32)],
}


def our_ways(workload: Workload, montecarlo: bool) -> Ways:
    """The copy, and our passes."""
    sketch, cameras = scene(workload)
    leaf, tensors = leaves(sketch)
    image = ds.render(sketch, cameras)
    upstream = upstream_of(image.color)
    planes = [image.color, image.alpha, image.depth]
    copies = [torch.empty_like(p) for p in planes]
    generator = torch.Generator().manual_seed(0)

    def both(**options: Any) -> Callable[[], object]:
        return lambda: torch.autograd.grad(ds.render(leaf, cameras, **options).color, tensors, upstream)

    ways: Ways = {
        "copy": lambda: [c.copy_(p) for c, p in zip(copies, planes, strict=True)],
        "forward": lambda: ds.render(sketch, cameras),
        "forward + backward": both(),
    }
    if montecarlo:
        options = {"antialiasing": ds.MonteCarlo(4, generator)}
        ways["Monte Carlo forward"] = lambda: ds.render(sketch, cameras, **options)
        ways["Monte Carlo forward + backward"] = both(**options)
    return ways


def upstream_of(color: torch.Tensor) -> torch.Tensor:
    """The fixed upstream gradient."""
    return torch.randn(color.shape, generator=torch.Generator().manual_seed(1))


def prototype_ways(stroke: Any, workload: Workload) -> Ways:
    """The prototype's kernels on the very strokes that `render` draws: projected, in pixels, as its arrays."""
    sketch, cameras = scene(workload)
    strokes = ds.project(sketch, cameras)
    size, views, count = workload.size, workload.views, workload.strokes
    control = (strokes.cubics[..., :2] / strokes.cubics[..., 2:3]).float().contiguous().numpy()
    weights = strokes.cubics[..., 2].float().contiguous().numpy()
    half_width = strokes.half_width.expand(views, count).contiguous().numpy()
    rgba = torch.cat([sketch.color, sketch.opacity[:, None]], 1).expand(views, count, 4).contiguous().numpy()
    arrays = (control, weights, half_width, rgba)
    color = ds.render(sketch, cameras).color
    upstream = upstream_of(color).numpy()
    theirs = torch.from_numpy(stroke.forward(*arrays, *size, save=False)[0])
    different = ((theirs - color).abs().amax(-1) > 0.01).double().mean().item()
    if different > SAME_PICTURE:
        raise RuntimeError(f"the prototype draws another picture: {different:.2%} of the pixels differ")
    return {
        "prototype forward": lambda: stroke.forward(*arrays, *size, save=False),
        "prototype forward + backward": lambda: stroke.backward(stroke.forward(*arrays, *size)[1], upstream),
    }


def time_workloads(names: str, stroke: Any, rounds: int) -> dict[str, dict[str, dict[str, Times]]]:
    """Times by workload, threads and way."""
    result: dict[str, dict[str, dict[str, Times]]] = {}
    for name in names:
        ways = our_ways(WORKLOADS[name], montecarlo=True)
        if stroke:
            ways |= prototype_ways(stroke, WORKLOADS[name])
        result[name] = {}
        for threads in THREADS:
            use_threads(threads, stroke)
            result[name][str(threads)] = interleaved(ways, rounds)
        show_times(name, result[name])
    return result


def use_threads(count: int, stroke: Any) -> None:
    """Threads of torch, which our kernels follow, and of the prototype."""
    torch.set_num_threads(count)
    if stroke:
        stroke.set_threads(count)


def show_times(name: str, times: dict[str, dict[str, Times]]) -> None:
    """A table of one workload."""
    rows = []
    for way, one in times["1"].items():
        cells: list[Any] = [way]
        for threads in times.values():
            base = threads.get(f"prototype {way}")
            cells += [threads[way], threads[way].median / threads["copy"].median]
            cells += [threads[way].median / base.median if base else None]
        rows.append([*cells, one.median / times["2"][way].median])
    columns = [
        "",
        "1 thread, ms [quartiles]",
        "x copy",
        "x prototype",
        "2 threads, ms",
        "x copy",
        "x prototype",
        "speed-up",
    ]
    show(f"{name}: {WORKLOADS[name]}; medians [quartiles]", columns, rows)


def time_reference(names: str, times: dict[str, dict[str, dict[str, Times]]]) -> dict[str, dict[str, float]]:
    """Ms of the reference, one call each with one thread."""
    torch.set_num_threads(1)
    rows, result = [], {}
    for name in names:
        sketch, cameras = scene(WORKLOADS[name])
        leaf, tensors = leaves(sketch)
        forward = milliseconds(lambda: ds.render(sketch, cameras, backend="reference"))  # noqa: B023
        color = ds.render(leaf, cameras, backend="reference").color
        both = forward + milliseconds(lambda: torch.autograd.grad(color, tensors, upstream_of(color)))  # noqa: B023
        result[name] = {"forward": forward, "forward + backward": both}
        ours = times[name]["1"]
        rows.append([name, *(x for way, t in result[name].items() for x in (t, t / ours[way].median))])
    show("Reference, 1 thread, one call", ["", "forward, ms", "x ours", "forward + backward, ms", "x ours"], rows)
    return result


def measure_memory(names: str) -> dict[str, float]:
    """MB above the images."""
    result = {name: peak_memory(WORKLOADS[name]) for name in names}
    rows = [[n, mb, images_mb(WORKLOADS[n]), MAX_MEMORY.get(n)] for n, mb in result.items()]
    show("Peak memory of forward + backward", ["", "MB above images", "images, MB", "at most, MB"], rows)
    return result


def images_mb(workload: Workload) -> float:
    """Size of colour, alpha and depth in float32."""
    return workload.views * workload.size[0] * workload.size[1] * 5 * 4 / 1e6


def measure_growth(rounds: int, largest: bool) -> dict[str, list[dict[str, Any]]]:
    """Times and memory over strokes, pixels and views, one thread."""
    torch.set_num_threads(1)
    result: dict[str, list[dict[str, Any]]] = {}
    for over, series in GROWTH.items():
        result[over], rows = [], []
        for workload in series if largest else series[:-2]:
            times = interleaved(our_ways(workload, montecarlo=False), rounds)
            memory = peak_memory(workload)
            result[over].append({"workload": workload, "times": times, "memory_mb": memory})
            rows.append([str(workload), *times.values(), memory, images_mb(workload)])
        columns = ["", "copy, ms", "forward, ms", "forward + backward, ms", "MB above images", "images, MB"]
        show(f"Growth over {over}, 1 thread", columns, rows)
    return result


def aims(times: dict[str, dict[str, dict[str, Times]]], memory: dict[str, float]) -> list[list[Any]]:
    """Rows (aim, figure, bound, met)."""
    rows: list[list[Any]] = []
    for name, by_threads in times.items():
        one, two = by_threads["1"], by_threads["2"]
        for way in ("forward", "forward + backward"):
            for threads, t in by_threads.items():
                if f"prototype {way}" in t and name in "ABC":
                    figure, base = t[way].median, t[f"prototype {way}"].median
                    bound = MAX_PROTOTYPE * base + (EXTRA_C if name == "C" else 0)
                    rows.append([f"{name} {way}, ms, threads: {threads}", figure, bound, figure <= bound])
            if name in "AB":
                speedup = one[way].median / two[way].median
                rows.append([f"{name} {way}, speed-up of two threads", speedup, MIN_SPEEDUP, speedup >= MIN_SPEEDUP])
        ratio = one["Monte Carlo forward + backward"].median / one["forward + backward"].median
        rows.append([f"{name} Monte Carlo 2x2 / analytic", ratio, MAX_MONTECARLO, ratio <= MAX_MONTECARLO])
        if name in MAX_MEMORY:
            rows.append([f"{name} MB above images", memory[name], MAX_MEMORY[name], memory[name] <= MAX_MEMORY[name]])
    return rows


def options() -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds, no reference on B and D, less growth")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="where to draw")
    parser.add_argument("--only", help="workloads to run, for example AB; skips growth")
    parser.add_argument("--prototype", type=Path, help="a folder with the package `stroke` of the prototype kernels")
    parser.add_argument("--json", type=Path, help="file for the figures")
    chosen = parser.parse_args()
    letters = "".join(WORKLOADS if chosen.device == "cpu" else render_cuda.GPU_WORKLOADS)
    chosen.only = letters if chosen.only is None else chosen.only
    if not chosen.only or set(chosen.only) - set(letters):
        parser.error(f"--only takes letters of {letters}, got {chosen.only!r}")
    if chosen.device == "cuda" and "cuda" not in ds.available_backends():
        parser.error("--device cuda: the CUDA kernels do not run here")
    if chosen.prototype and not (chosen.prototype / "stroke").is_dir():
        parser.error(f"--prototype: no package `stroke` in {chosen.prototype}")
    return chosen


def main() -> None:
    """Measures and prints."""
    chosen = options()
    if chosen.device == "cuda":
        render_cuda.main(chosen.only, chosen.quick, chosen.json)
        return
    stroke = None
    if chosen.prototype:
        sys.path.insert(0, str(chosen.prototype))
        stroke = importlib.import_module("stroke")
    about = environment()
    say("  ".join(f"{k}: {v}" for k, v in about.items()))
    figures: dict[str, Any] = {"ms": time_workloads(chosen.only, stroke, 3 if chosen.quick else 20)}
    referenced = "".join(n for n in chosen.only if not chosen.quick or n in "AC")
    figures["reference_ms"] = time_reference(referenced, figures["ms"])
    figures["memory_mb"] = measure_memory(chosen.only)
    if set(chosen.only) == set(WORKLOADS):
        figures["growth"] = measure_growth(2 if chosen.quick else 5, not chosen.quick)
    figures["aims"] = aims(figures["ms"], figures["memory_mb"])
    rows = [[aim, figure, bound, "yes" if met else "NO"] for aim, figure, bound, met in figures["aims"]]
    show("Aims", ["", "figure", "bound", "met"], rows)
    if chosen.json:
        write_json(chosen.json, about, figures)


if __name__ == "__main__":
    main()
