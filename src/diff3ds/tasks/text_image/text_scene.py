"""A phrase of several things to one sketch: each is distilled by itself, and then they are placed."""

import json
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import write_text
from diff3ds.formats import load
from diff3ds.formats.mesh import load_mesh
from diff3ds.library.faces import Faces
from diff3ds.library.layout import arranged_solids
from diff3ds.library.phrase import Request
from diff3ds.library.scene import Scene
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.progress import Progress, Report, Stopped
from diff3ds.tasks.results import SURFACE, RunInfo, seen_around, turntable, write_results
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior
from diff3ds.tasks.text_image.distillation import CHECKPOINT, distill
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase

# What was understood, in the folder of the run from its start; and the folder of the things' own runs.
PLAN, THINGS = "scene.json", "things"


def run_scene(
    scene: Scene,
    prior_for: Callable[[RunSpec[Phrase], Request], ConditionedPrior],
    spec: RunSpec[Phrase],
    out: Path,
    report: Report,
) -> Sketch:
    """Makes a sketch of each thing, places them and writes the folder of the run; each thing has a run's folder in it.

    Ctrl-C ends it early, with what there is of the things; a resumed run goes on with the thing it was at.

    Args:
        prior_for: the prior that is told one thing.
        out: a folder that `check_output_folder` has found free.

    Raises:
        ValueError: the run to be resumed is of another phrase; as `distill`.
        Stopped: ended early.
    """
    begun = time.perf_counter()
    plan: dict[str, Any] = {"phrase": spec.subject.phrase, "things": [t.said for t in scene.things]}
    plan |= {"relations": [asdict(relation) for relation in scene.relations]}
    if spec.output.resume and json.loads((out / PLAN).read_text())["phrase"] != spec.subject.phrase:
        raise ValueError(f"{out} holds a run of another phrase: give that one to resume it, or another folder (-o)")
    if not spec.output.resume:
        forget_scene(out)
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / PLAN, json.dumps(plan, indent=1))
    sketches: list[Sketch] = []
    stopped = False
    names = [f"{number + 1}_{thing.request.category.replace(' ', '_')}" for number, thing in enumerate(scene.things)]
    folders = [out / THINGS / name for name in names]
    for folder, thing in zip(folders, scene.things, strict=True):
        one = replace(spec, subject=replace(spec.subject, phrase=thing.one))
        if spec.output.resume and _is_done(folder):
            sketches.append(load(folder / "sketch.json"))
            continue
        goes_on = spec.output.resume and (folder / CHECKPOINT).exists()
        one = replace(one, output=replace(spec.output, resume=goes_on))
        try:
            sketches.append(distill(prior_for(one, thing.request), one, folder, _naming(report, thing.said)))
        except Stopped:
            sketches.append(load(folder / "sketch.json"))
            stopped = True
            break
    seconds = {"things": time.perf_counter() - begun}
    there = _so_far(scene, len(sketches))
    sketch, faces = arranged_solids(there, sketches, [_faces_in(folder) for folder in folders[: len(sketches)]])
    surface = TriangleMesh.of_triangles(faces.numpy()) if len(faces) else None
    # Each of them had its own.
    sketch = sketch.replace(importance=None)
    around = turntable(sketch)
    given = {**spec.subject.record, **spec.options()}
    chosen = {"things": plan["things"], "relations": plan["relations"]}
    info = RunInfo(given, chosen, seconds, [], {}, stopped)
    seen = seen_around(sketch, around, surface) if spec.page.page is None else None
    sketch = write_results(out, sketch, around, seen, info, surface, page=spec.page)
    if stopped:
        raise Stopped
    return sketch


def forget_scene(out: Path) -> None:
    """Deletes what a scene left in a folder that a run of one thing may have."""
    if (out / PLAN).exists():
        (out / PLAN).unlink()
        shutil.rmtree(out / THINGS, ignore_errors=True)


def _faces_in(folder: Path) -> Faces:
    """The faces that hide lines of a thing: none where its run knows of none, or nothing here reads meshes."""
    none = torch.zeros(0, 3, 3, dtype=torch.float64)
    if not (folder / SURFACE).exists():
        return none
    try:
        vertices, faces = load_mesh(folder / SURFACE)
    except ImportError:
        return none
    return torch.from_numpy(vertices[faces])


def _is_done(folder: Path) -> bool:
    """Whether a thing's run came to its end."""
    path = folder / "run.json"
    return path.exists() and not json.loads(path.read_text())["stopped_early"]


def _naming(report: Report, said: str) -> Report:
    """Reports that say which thing they are about."""

    def told(progress: Progress) -> None:
        report(replace(progress, stage=f"{said}: {progress.stage}"))

    return told


def _so_far(scene: Scene, count: int) -> Scene:
    """The scene of its first things alone."""
    relations = (r for r in scene.relations if r.thing < count and all(target < count for target in r.targets))
    return Scene(scene.things[:count], tuple(relations))
