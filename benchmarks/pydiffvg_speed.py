"""diff3ds.pydiffvg next to DiffVG itself, in one run: forward, and forward with backward; steadiness and memory.

    python benchmarks/pydiffvg_speed.py [--svg FILE ...] [--rounds N] [--steps N] [--json FILE]

A build of DiffVG (https://github.com/BachiLi/diffvg; DIFFVG_CUDA=0 will do) must be what `import pydiffvg` gives:
without one, only the times of diff3ds are taken. DiffVG draws with all cores, diff3ds with as many threads. Scenes have
the size, strokes and samples a pixel of the programs that are named; the files are DiffVG's examples. Backward is the
gradient of the sum over pixels to all points, widths and colours.
"""

import argparse
import importlib
import random
import resource
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import torch
from report import environment, say, show, write_json
from timing import Times, interleaved

from diff3ds import pydiffvg as ours

Scene = tuple[int, int, list[Any], list[Any]]
SAMPLES = 2


def diffvg() -> ModuleType | None:
    """DiffVG itself."""
    try:
        found = importlib.import_module("pydiffvg")
    except ImportError:
        return None
    found.set_use_gpu(False)
    return None if found is ours or "diff3ds" in str(found.__file__) else found


def clipasso(module: ModuleType) -> Scene:
    """16 black strokes of one cubic each on 224 x 224 pixels."""
    return strokes(module, 16, 224, lambda: 1, 1.5, lambda: [0.0, 0.0, 0.0, 1.0])


def painterly(module: ModuleType) -> Scene:
    """512 strokes of one to three cubics in translucent colours, 512 x 512."""
    return strokes(module, 512, 512, lambda: random.randint(1, 3), 1.0, lambda: [random.random() for _ in range(4)])


def strokes(
    module: ModuleType,
    count: int,
    size: int,
    segments: Callable[[], int],
    width: float,
    color: Callable[[], list[float]],
) -> Scene:
    """Strokes that wander from random places, by steps of a twentieth of the picture."""
    random.seed(0)
    shapes, groups = [], []
    for i in range(count):
        cubics = segments()
        steps = torch.tensor([[random.random() - 0.5 for _ in range(2)] for _ in range(3 * cubics)]) * 0.05
        start = torch.tensor([[random.random(), random.random()]])
        points = torch.cat([start, start + steps.cumsum(0)]) * size
        shapes.append(module.Path(torch.full((cubics,), 2, dtype=torch.int32), points, False, torch.tensor(width)))
        groups.append(module.ShapeGroup(torch.tensor([i]), None, stroke_color=torch.tensor(color())))
    return size, size, shapes, groups


def blobs(module: ModuleType) -> Scene:
    """512 closed shapes of three to five cubics in translucent colours, 512 x 512."""
    size, _, shapes, groups = strokes(
        module, 512, 512, lambda: random.randint(3, 5), 1.0, lambda: [random.random() for _ in range(4)]
    )
    for shape, group in zip(shapes, groups, strict=True):
        shape.points, shape.is_closed = shape.points[:-1].contiguous(), True
        group.fill_color, group.stroke_color = group.stroke_color, None
    return size, size, shapes, groups


def from_file(path: Path) -> Callable[[ModuleType], Scene]:
    """The scene of an SVG, at its own size."""
    return lambda module: module.svg_to_scene(str(path))


def leaves(scene: Scene) -> list[torch.Tensor]:
    """Points, widths and colours, to be differentiated."""
    colors = [c for group in scene[3] for c in (group.fill_color, group.stroke_color) if isinstance(c, torch.Tensor)]
    points = [shape.points for shape in scene[2] if hasattr(shape, "points")]
    found = {id(t): t for t in [*points, *(shape.stroke_width for shape in scene[2]), *colors]}
    return [t.requires_grad_(True) for t in found.values()]


def forward(module: ModuleType, scene: Scene, seed: int = 0) -> torch.Tensor:
    """The picture (H, W, 4)."""
    width, height, shapes, groups = scene
    arguments = module.RenderFunction.serialize_scene(width, height, shapes, groups)
    return module.RenderFunction.apply(width, height, SAMPLES, SAMPLES, seed, None, *arguments)


def ways_of(module: ModuleType, make: Callable[[ModuleType], Scene]) -> dict[str, Callable[[], object]]:
    """Forward without gradients, and forward with backward."""
    plain, learned = make(module), make(module)
    tensors = leaves(learned)

    def both() -> None:
        forward(module, learned).sum().backward()
        for tensor in tensors:
            tensor.grad = None

    return {"forward": lambda: forward(module, plain), "forward + backward": both}


def compared(make: Callable[[ModuleType], Scene], theirs: ModuleType | None, rounds: int) -> dict[str, Any]:
    """Milliseconds of both, and how many times as fast ours is."""
    modules = {"diff3ds": ours} | ({"DiffVG": theirs} if theirs else {})
    ways = {f"{name}, {way}": call for name, m in modules.items() for way, call in ways_of(m, make).items()}
    times: dict[str, Any] = dict(interleaved(ways, rounds))
    if theirs:
        for way in ("forward", "forward + backward"):
            times[f"ratio, {way}"] = times[f"DiffVG, {way}"].median / times[f"diff3ds, {way}"].median
    return times


def steadiness(steps: int) -> dict[str, Any]:
    """Steps in CLIPasso's setting: MB that the peak grew after the first tenth, and whether two runs end alike."""
    ends, grown = [], 0.0
    for _ in range(2):
        scene = clipasso(ours)
        optimizer = torch.optim.Adam(leaves(scene)[:16], lr=1.0)
        for step in range(steps):
            optimizer.zero_grad()
            forward(ours, scene, step)[..., 3].square().mean().neg().backward()
            optimizer.step()
            if step == steps // 10:
                before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        grown = max(grown, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3)
        ends.append(torch.cat([shape.points.detach() for shape in scene[2]]))
    return {"steps": steps, "MB grown": grown, "the same bytes": torch.equal(*ends)}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--svg", nargs="*", type=Path, default=[])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    about, theirs = environment(), diffvg()
    makes: dict[str, Callable[[ModuleType], Scene]] = {
        "CLIPasso: 16 strokes, 224²": clipasso,
        "painterly_rendering: 512 strokes, 512²": painterly,
        "painterly_rendering --use_blob: 512 fills, 512²": blobs,
        **{path.name: from_file(path) for path in options.svg},
    }
    figures: dict[str, Any] = {"threads": torch.get_num_threads(), "ms": {}}
    for name, make in makes.items():
        figures["ms"][name] = compared(make, theirs, options.rounds)
        show(
            name,
            ["ms", "median [quartiles]"],
            [[k, str(v) if isinstance(v, Times) else v] for k, v in figures["ms"][name].items()],
        )
    figures["steadiness"] = steadiness(options.steps)
    say(str(figures["steadiness"]))
    if options.json:
        write_json(options.json, about, figures)


if __name__ == "__main__":
    main()
