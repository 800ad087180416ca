"""A cloud of points to a sketch of the edges of what it was taken from: where the forms that explain it meet."""

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from diff3ds._settings import option_values
from diff3ds.curves.importance import ranked
from diff3ds.formats import tile_images
from diff3ds.formats.clouds.read_cloud import Cloud, read_cloud
from diff3ds.formats.framing import framed
from diff3ds.render import render
from diff3ds.sketch import Sketch
from diff3ds.surfaces.form.form_curves import FormCurves, form_curves
from diff3ds.surfaces.form.samples import Samples
from diff3ds.tasks.detail_options import DetailOptions
from diff3ds.tasks.form_lines import form_lines, thinned, told_forms, with_tangents
from diff3ds.tasks.points.points_options import PointsOptions
from diff3ds.tasks.progress import Progress, Report
from diff3ds.tasks.results import RunInfo, check_output_folder, write_results
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.sketch_input import at_level

# Of more points than this so many are looked at: edges are found from many fewer. Empirical.
MOST_POINTS = 60_000
# Points without a form that are so far from any surface, in distances from their neighbours, are on none. Empirical.
NO_SURFACE = 0.3
# Fewer say nothing of a surface.
LEAST_POINTS = 100


def run_points(
    source: Path,
    out: Path,
    options: PointsOptions,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Makes a sketch of the edges in a cloud of points, and writes the folder of the run.

    Args:
        source: PLY, XYZ or another text, NPY, PCD, LAS or LAZ.
        out: folder of the results.
        options: of the command.
        report: called once the edges are found.
        say: told what is left out.

    Raises:
        ValueError, OSError, ImportError: as `read_cloud` and `check_output_folder`; fewer than a hundred points; no
            edges, with what was found instead.
    """
    with logged(out, report, say) as (report, say):
        return _drawn_points(source, out, options, report, say)


def _drawn_points(
    source: Path, out: Path, options: PointsOptions, report: Report, say: Callable[[str], None]
) -> Sketch:
    """Reads, finds the edges and writes."""
    begun = time.perf_counter()
    cloud = _read(source, options, say)
    check_output_folder(out, out / "run.json", False, options.overwrite)
    seconds = {"read": time.perf_counter() - begun}
    middle, size = cloud.points.mean(0), float(np.ptp(cloud.points, axis=0).max())
    samples = Samples.of_points((cloud.points - middle) / size, cloud.normals)
    found = form_curves(samples, options.seed, options.rounded)
    if not len(found.curves) or (not found.found.forms and samples.noise > NO_SURFACE * samples.spacing):
        raise ValueError(f"{source}: no edge was found: {_told(found)}")
    sketch, kinds = with_tangents(*form_lines(found, middle, size), options.tangent)
    if not len(sketch):
        raise ValueError(
            f"{source}: all its {len(found.edges)} edges are rounded, and --tangent hidden leaves them out"
        )
    sketch, order = ranked(thinned(sketch, kinds, options.tangent))
    sketch, rows = at_level(sketch, DetailOptions(options.detail, options.strokes))
    kinds = tuple(kinds[order[row]] for row in rows)
    seconds["edges"] = time.perf_counter() - begun - sum(seconds.values())
    report(Progress("edges", 1, 1, None, len(sketch), sketch=sketch.detach))
    view = options.view
    box = Sketch(torch.from_numpy(np.repeat(cloud.points[:, None], 2, 1)))
    cameras = framed(
        box, view.azimuth, view.elevation, size=options.size, distance=view.distance, fov=view.fov, height=view.height
    )
    told = told_forms(found, middle, size)
    info = RunInfo({"source": str(source), **option_values(options)}, told, seconds, [], {}, False)
    preview = None
    if options.page.page is None:
        preview = tile_images(render(sketch, cameras).color.float(), columns=min(len(cameras), 2))
    return write_results(out, sketch.replace(kinds=kinds), cameras, preview, info, layers=kinds, page=options.page)


def _read(source: Path, options: PointsOptions, say: Callable[[str], None]) -> Cloud:
    """The cloud with z up, and no more of it than is looked at."""
    cloud = read_cloud(source)
    count = len(cloud.points)
    if count < LEAST_POINTS:
        raise ValueError(f"{source}: {count} points are too few to tell a surface from, it takes {LEAST_POINTS}")
    if options.up == "y":
        turned = [2, 0, 1]
        cloud = Cloud(cloud.points[:, turned], None if cloud.normals is None else cloud.normals[:, turned])
    if count <= MOST_POINTS:
        return cloud
    say(f"of {count} points {MOST_POINTS}, taken at random, are looked at")
    rows = np.sort(np.random.default_rng(options.seed).choice(count, MOST_POINTS, replace=False))
    return Cloud(cloud.points[rows], None if cloud.normals is None else cloud.normals[rows])


def _told(found: FormCurves) -> str:
    """What a cloud is made of, in a sentence."""
    forms, label = found.found.forms, found.found.label
    if not forms:
        return "no part of it is a plane, a cylinder, a cone, a sphere or a torus, nor smooth in any other way"
    names = Counter(one.kind.name.lower() for one in forms)
    parts = ", ".join(f"{count} {name}{'s' * (count > 1)}" for name, count in names.items())
    return f"{(label >= 0).mean():.0%} of it is {parts.replace('toruss', 'tori')}, no two of which meet at an edge"
