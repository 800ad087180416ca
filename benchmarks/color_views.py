"""Coloured sketches: how well they show held-out views, by number of strokes, with depth and with a fixed order.

    python benchmarks/color_views.py [--scenes chair rings ball] [--strokes 64 256 1024] [--steps N] [--pictures FOLDER]

The same fit is run twice: strokes hide each other by their depth in every pixel, as they do in space, or they are drawn
over each other in the order of their creation, as by renderers of flat drawings. `rings` and `ball` are generated;
`chair` is nerf_synthetic/chair in the folder that DIFF3DS_DATA names, and is left out without it.
"""

import argparse
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from occlusion_scenes import caged_ball, linked_rings, pictures_of
from report import environment, say, show, write_json

import diff3ds as ds
from diff3ds.formats import save_png, tile_images
from diff3ds.losses import psnr
from diff3ds.metrics.ssim import ssim
from diff3ds.optimize.fit import fit
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.project import Strokes2D, project
from diff3ds.render import rasterize
from diff3ds.tasks.views.color_fit.color_sketch import plan_color
from diff3ds.tasks.views.plan import Plan
from diff3ds.tasks.views.views_options import ViewsOptions

RESULTS = Path(__file__).parent / "results" / "color_views.json"
TRAINING, HELD_OUT = 60, 15
ORDERS: dict[str, Callable[[ds.Sketch, ds.Cameras], Strokes2D]]


def by_creation(sketch: ds.Sketch, cameras: ds.Cameras) -> Strokes2D:
    """The strokes as they appear in space, but each behind those created after it.

    A stroke's depth is Z / W. With W = Z / k it is k everywhere, and the curve on the screen (X / Z, Y / Z) stays. Its
    width in pixels becomes that at the stroke's mean depth.
    """
    strokes = project(sketch, cameras)
    depth = strokes.cubics[..., 2].mean(-1) / strokes.cubics[..., 3].mean(-1)
    rank = torch.arange(len(sketch), 0, -1, dtype=torch.float64)
    # Control points beside or behind the camera have no W that is positive; there are none in these scenes.
    cubics = torch.cat([strokes.cubics[..., :3], strokes.cubics[..., 2:3] / rank[:, None, None]], -1)
    half_width = strokes.half_width
    if strokes.width_space == "world":
        half_width = half_width * (rank / depth).to(half_width.dtype)
    return replace(strokes, cubics=cubics, half_width=half_width)


ORDERS = {"depth": project, "creation": by_creation}


def scenes(wanted: list[str]) -> dict[str, tuple[PosedPictures, PosedPictures]]:
    """Pictures to fit and held-out ones, by name."""
    generated = {"rings": linked_rings, "ball": caged_ball}
    found = {}
    for name in wanted:
        if name in generated:
            sketch = generated[name]()
            found[name] = pictures_of(sketch, TRAINING, 0.0), pictures_of(sketch, HELD_OUT, 50.0)
        elif "DIFF3DS_DATA" in os.environ:
            folder = Path(os.environ["DIFF3DS_DATA"]) / "nerf_synthetic" / name
            found[name] = tuple(load_posed(folder / f"transforms_{part}.json", "color") for part in ("train", "test"))
    return found


def fitted(plan: Plan, order: str) -> tuple[ds.Sketch, float]:
    """The sketch in the frame of the plan, and the seconds that it took."""
    drawn = ORDERS[order]
    refinements = [replace(refine, project=drawn) for refine in plan.config.refinements]
    config = replace(plan.config, project=lambda sketch, cameras, step: drawn(sketch, cameras), refinements=refinements)
    begun = time.perf_counter()
    (last,) = deque(fit(plan.start, plan.objective, plan.pyramid.cameras, config), maxlen=1)
    return last.sketch, time.perf_counter() - begun


def drawings(sketch: ds.Sketch, cameras: ds.Cameras, order: str) -> torch.Tensor:
    """What the views show, over white."""
    views = [rasterize(ORDERS[order](sketch, cameras[i]), cameras.size).color for i in range(len(cameras))]
    return torch.cat(views).clamp(0, 1)


def run(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """One row for every scene, number of strokes and order."""
    for name, (pictures, held_out) in scenes(options.scenes).items():
        for count in options.strokes:
            shown = []
            for order in ORDERS:
                begun = time.perf_counter()
                plan = plan_color(pictures, ViewsOptions(strokes=count, steps=options.steps), None)
                planned = time.perf_counter() - begun
                sketch, seconds = fitted(plan, order)
                images = drawings(sketch, plan.frame.cameras(held_out.cameras), order)
                target = held_out.batch(range(len(held_out))).images
                row = {"scene": name, "strokes": len(sketch), "order": order, "seconds": round(planned + seconds, 1)}
                row |= {"psnr": round(psnr(images, target), 3), "ssim": round(ssim(images, target), 4)}
                yield {**row, "steps": plan.config.steps}
                shown.append(images)
            if options.pictures:
                some = torch.arange(4) * len(held_out) // 4
                tiles = torch.cat([target[some], *(images[some] for images in shown)])
                save_png(options.pictures / f"{name}-{count}.png", tile_images(tiles, columns=4))


def main() -> None:
    """Prints the table and writes it, with the pictures if asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["chair", "rings", "ball"])
    parser.add_argument("--strokes", nargs="+", type=int, default=[64, 256, 1024])
    parser.add_argument("--steps", type=int, help="gradient steps; default that of diff3ds views")
    parser.add_argument("--threads", type=int, help="default all")
    parser.add_argument("--pictures", type=Path, help="folder for pictures: targets, by depth, by creation")
    parser.add_argument("-o", "--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    if options.threads:
        ds.set_num_threads(options.threads)
        torch.set_num_threads(options.threads)
    about = environment() | {"threads": ds.get_num_threads()}
    rows = []
    for row in run(options):
        rows.append(row)
        say(str(row))
        # After every row: a run takes long, and may be broken off.
        write_json(options.out, about, {"rows": rows})
    names = ("scene", "strokes", "order", "seconds", "psnr", "ssim")
    show("Held-out views", names, [[row[name] for name in names] for row in rows])


if __name__ == "__main__":
    main()
