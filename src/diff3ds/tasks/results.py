"""The folder that a run writes: sketch.json, sketch.svg, sketch.step, preview.png, run.json."""

import json
import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

import diff3ds
from diff3ds._files import write_text
from diff3ds._shapes import Float, Int, Tensor
from diff3ds.formats import save, save_png, tile_images
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.tasks.posed import PosedPictures

PREVIEWS = 8
SVG_VIEWS = 4
# Losses in run.json: enough for a plot.
MOST_LOSSES = 500


@dataclass(frozen=True)
class RunInfo:
    """What run.json says about a run.

    Attributes:
        options: as the user gave them.
        chosen: what was found out or filled in.
        seconds: wall time by part.
        losses: of every step.
        scores: of the result.
        stopped: whether it was ended early.
    """

    options: dict[str, Any]
    chosen: dict[str, Any]
    seconds: dict[str, float]
    losses: list[float]
    scores: dict[str, float]
    stopped: bool


def write_results(out: Path, sketch: Sketch, pictures: PosedPictures, info: RunInfo) -> None:
    """Writes all files of a run, each whole or not at all."""
    save(out / "sketch.json", sketch)
    save(out / "sketch.step", sketch)
    save(out / "sketch.svg", sketch, pictures.cameras[spread(len(pictures), SVG_VIEWS)])
    save_png(out / "preview.png", preview(sketch, pictures))
    every = -(-len(info.losses) // MOST_LOSSES) or 1
    content = {
        "options": {k: str(v) if isinstance(v, Path) else v for k, v in info.options.items()},
        **info.chosen,
        "strokes_left": len(sketch),
        "steps_done": len(info.losses),
        "stopped_early": info.stopped,
        "scores": info.scores,
        "seconds": {name: round(value, 3) for name, value in info.seconds.items()},
        "versions": {
            "diff3ds": diff3ds.__version__,
            "torch": torch.__version__,
            "python": platform.python_version(),
            "machine": platform.machine(),
            "threads": diff3ds.get_num_threads(),
            "backends": diff3ds.available_backends(),
        },
        "loss": {"every": every, "values": info.losses[::every]},
    }
    write_text(out / "run.json", json.dumps(content, indent=1))


def preview(sketch: Sketch, pictures: PosedPictures) -> Float[Tensor, "H W 3"]:
    """Eight views, each target beside the rendering of the sketch."""
    views = spread(len(pictures), PREVIEWS)
    drawn = render(sketch, pictures.cameras[views]).color
    pairs = torch.cat([pictures.batch(views).images, drawn.clamp(0, 1)], 2)
    return tile_images(pairs, columns=2)


def spread(count: int, wanted: int) -> Int[Tensor, " M"]:
    """Up to `wanted` indices evenly over so many."""
    return torch.arange(min(count, wanted)) * count // min(count, wanted)
