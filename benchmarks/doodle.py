"""The paper's comparison with 3Doodle: 120 horizontal views of a generated object, fitted by 3Doodle's losses.

    python benchmarks/doodle.py -o OUT [--source VIEWS | --object ball] [--clip-rn101 W] [--vgg16 W] [--clip W ...]

Takes posed views of an object that some other program generated (--source, a transforms.json or a folder with one), or
120 horizontal views of an object of this benchmark's own. Fits each with VGG16's distance as 3Doodle's code has it and
as it should be; OUT/3doodle/NAME and OUT/standard/NAME are runs as of `diff3ds views`.

With --clip (and LPIPS's weights) runs of the benchmark's own object are scored as by `diff3ds eval`; give others a
reference.png and call that. --random-weights measures the time that a step takes without any weights: full-size
networks that have learned nothing, so that the sketches mean nothing.
"""

import argparse
import json
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import torch
from occlusion_scenes import caged_ball, linked_rings
from report import environment, say, show, write_json
from safetensors.torch import save_file

import diff3ds as ds
from diff3ds.formats import save_png
from diff3ds.metrics.clip_resnet import ClipResnet
from diff3ds.metrics.feature_stacks import untrained_stack
from diff3ds.metrics.vgg_distance import Variant
from diff3ds.tasks.evaluate.evaluate import evaluate
from diff3ds.tasks.evaluate.evaluate_options import JudgeOptions
from diff3ds.tasks.views.color_fit.doodle import run_doodle
from diff3ds.tasks.views.views_options import DoodleOptions

RESULTS = Path(__file__).parent / "results" / "doodle.json"
OBJECTS = {"ball": caged_ball, "rings": linked_rings}
# The paper says no more than 120 horizontal views. The cameras are those of `diff3ds image` and `diff3ds eval`.
VIEWS, DISTANCE, FOV, SIZE = 120, 2.0, 60.0, 400


def horizontal_views(sketch: ds.Sketch, folder: Path) -> Path:
    """Writes 120 pictures with alpha, from every third degree at elevation 0; returns their transforms.json."""
    cameras = ds.orbit([360 * i / VIEWS for i in range(VIEWS)], 0.0, DISTANCE, fov=FOV, size=SIZE)
    names = [f"{i:03d}.png" for i in range(VIEWS)]
    for i, name in enumerate(names):
        drawn = ds.render(sketch, cameras[i], background=0.0)
        alpha = drawn.alpha[0, ..., None]
        # PNG files have straight colours.
        save_png(folder / name, torch.cat([drawn.color[0] / alpha.clamp(min=1e-6), alpha], -1).clamp(0, 1))
    ds.save_transforms(folder / "transforms.json", cameras, names)
    return folder / "transforms.json"


def random_weights(folder: Path) -> dict[str, str]:
    """Files with full-size networks that have learned nothing."""
    torch.manual_seed(0)
    folder.mkdir(parents=True, exist_ok=True)
    tower = ClipResnet(64, (3, 4, 23, 3), 7, 512).state_dict()
    save_file({f"visual.{name}": value for name, value in tower.items()}, folder / "rn101.safetensors")
    save_file(untrained_stack("vgg").state_dict(), folder / "vgg16.safetensors")
    return {"clip_rn101": str(folder / "rn101.safetensors"), "vgg16": str(folder / "vgg16.safetensors")}


def run(variant: str, source: Path, options: argparse.Namespace) -> dict[str, Any]:
    """One fit and its row."""
    given = {
        f.name: getattr(options, f.name) for f in fields(DoodleOptions) if getattr(options, f.name, None) is not None
    }
    out = options.out / variant / (source.parent if source.is_file() else source).name
    sketch = run_doodle(source, out, DoodleOptions(**given, vgg=variant, overwrite=True))
    if options.source is None:
        # Makes it a run of a picture for `diff3ds eval`, which looks from there.
        (out / "reference.png").write_bytes((source.parent / "000.png").read_bytes())
    about = json.loads((out / "run.json").read_text())
    seconds, steps = about["seconds"]["fit"], about["steps_done"]
    row = {"variant": variant, "strokes": len(sketch), "steps": steps, "seconds": seconds, "s a step": seconds / steps}
    return row | {name.split("_")[0]: value for name, value in about["scores"].items()}


def parser() -> argparse.ArgumentParser:
    """Options, by the names that they have in `DoodleOptions` and `JudgeOptions`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder of the pictures and the runs")
    parser.add_argument("--source", type=Path, help="posed views, instead of an object of the benchmark's own")
    parser.add_argument("--object", choices=OBJECTS, default="ball")
    parser.add_argument("--variants", nargs="+", choices=get_args(Variant), default=get_args(Variant))
    for name in ("clip-rn101", "vgg16", "device", "alexnet", "lpips-alex"):
        parser.add_argument(f"--{name}", help="as of diff3ds views --recipe 3doodle, or of diff3ds eval")
    for name in ("steps", "strokes", "batch", "size"):
        parser.add_argument(f"--{name}", type=int, help="default that of 3Doodle")
    parser.add_argument("--clip", nargs="+", help="CLIP models that score the runs")
    parser.add_argument("--random-weights", action="store_true", help="full-size networks that have learned nothing")
    parser.add_argument("--threads", type=int, help="default all")
    parser.add_argument("--results", type=Path, default=RESULTS)
    return parser


def main() -> None:
    """Fits, prints the table and writes it."""
    options = parser().parse_args()
    if options.threads:
        ds.set_num_threads(options.threads)
        torch.set_num_threads(options.threads)
    about = environment() | {
        "threads": ds.get_num_threads(),
        "weights": "random" if options.random_weights else "given",
    }
    if options.random_weights:
        for name, path in random_weights(options.out / "random").items():
            setattr(options, name, path)
    source = options.source or horizontal_views(OBJECTS[options.object](), options.out / "pictures" / options.object)
    rows = []
    for variant in options.variants:
        rows.append(run(variant, source, options))
        say(str(rows[-1]))
        # After every row: a run takes long, and may be broken off.
        write_json(options.results, about, {"rows": rows})
    show("3Doodle's losses", list(rows[0]), [list(row.values()) for row in rows])
    names = ("alexnet", "lpips_alex", "device")
    judges = {name: getattr(options, name) for name in names if getattr(options, name)}
    if options.clip and options.source is None:
        found = evaluate(options.out, options.out / "scores", JudgeOptions(clip=tuple(options.clip), **judges))
        show("Scores", ["method", *found[0].scores], [[row.method, *row.scores.values()] for row in found])


if __name__ == "__main__":
    main()
