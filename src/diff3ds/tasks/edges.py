"""Edge maps, line drawings, or the edges of coloured pictures to a sketch of lines, arcs and cubics."""

from pathlib import Path

import torch

from diff3ds._shapes import Int, Tensor
from diff3ds.edges.checkpoint import read_result, write_result
from diff3ds.edges.curves import Curves
from diff3ds.edges.primitives import Kind
from diff3ds.edges.reconstruct import STEPS, Result, reconstruct
from diff3ds.edges.ridges import Ridges, color_ridges, map_ridges, within, without_faint
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.frame import Frame, frame_of
from diff3ds.tasks.linewidth import line_width
from diff3ds.tasks.plan import ViewsOptions
from diff3ds.tasks.posed import PosedPictures
from diff3ds.tasks.progress import Fitted, Progress, Report
from diff3ds.tasks.results import spread
from diff3ds.tasks.store import is_all_known

# Beyond so many views, evenly chosen ones do: the rest would cost memory and say the same. Of large pictures fewer are
# kept, 48 of 3840 x 2160: each pixel takes up to eight bytes.
MOST_VIEWS, MOST_PIXELS, FEWEST_VIEWS = 200, 400_000_000, 3


def fit_edges(
    pictures: PosedPictures, options: ViewsOptions, checkpoint: Path, report: Report, start: Sketch | None = None
) -> Fitted:
    """The sketch of what the views' edges agree on.

    Args:
        checkpoint: file that keeps what is reached after each stage.
        report: called as it goes on.
        start: curves in the frame of the views, to refine instead of those found by carving.

    Raises:
        ValueError: as `frame_of`, `reconstruct` and `read_result`.
        KeyboardInterrupt: before the first curves were found.
    """
    frame = frame_of(pictures.cameras, pictures.store)
    views = spread(len(pictures), most_views(pictures.cameras.size))
    cameras = frame.cameras(pictures.cameras[views])
    settings = _settings(pictures, options)
    results: list[Result] = []
    losses: list[float] = []
    if options.resume and checkpoint.exists():
        reached, losses = read_result(checkpoint, settings)
        results.append(reached)

    def save(result: Result) -> None:
        results.append(result)
        write_result(checkpoint, result, losses, settings)

    def tell(stage: str, step: int, loss: float | None, strokes: int) -> None:
        losses.extend([] if loss is None else [loss])
        report(Progress(stage, step, None if loss is None else STEPS, loss, strokes))

    report(Progress("edges of the pictures", 0, None, None, 0))
    ridges = ridges_of(pictures, views)
    stopped = False
    try:
        reconstruct(
            cameras,
            ridges,
            start=None if start is None else _free(start),
            reached=results[-1] if results else None,
            save=save,
            report=tell,
            seed=options.seed,
        )
    except KeyboardInterrupt:
        if not results:
            raise
        stopped = True
    return _fitted(pictures, frame, results[-1], losses, stopped)


def most_views(size: tuple[int, int]) -> int:
    """How many views of this size are looked at."""
    return max(FEWEST_VIEWS, min(MOST_VIEWS, MOST_PIXELS // (size[0] * size[1])))


def _settings(pictures: PosedPictures, options: ViewsOptions) -> dict[str, object]:
    """What must be the same for a run to go on."""
    names = ["init", "seed", *(["strokes", "steps", "batch"] if options.init == "random" else [])]
    about = {"target": pictures.target, "size": list(pictures.cameras.size), "pictures": pictures.digest()}
    return {**about, **{name: getattr(options, name) for name in names}}


def ridges_of(pictures: PosedPictures, views: Int[Tensor, " B"]) -> list[Ridges]:
    """The edges of these views, at subpixel precision."""
    found = []
    for view in views.tolist():
        batch = pictures.batch([view])
        pixels = batch.pixels[0].numpy()
        ridges = map_ridges(pixels[..., 0]) if pixels.shape[-1] == 1 else color_ridges(pixels)
        found.append(ridges if is_all_known(pictures.store.known) else within(ridges, batch.known[0].numpy()))
    # The logarithm of a gradient says nothing about doubt.
    return without_faint(found) if pictures.target == "edges" else found


def _free(start: Sketch) -> Curves:
    """The strokes as cubics that are nothing else yet."""
    count = len(start)
    kind = torch.full((count,), int(Kind.FREE))
    return Curves(start.elevate(3).points, kind, torch.arange(2 * count).reshape(count, 2), torch.full((count,), -1))


def _fitted(pictures: PosedPictures, frame: Frame, result: Result, losses: list[float], stopped: bool) -> Fitted:
    drawn = pictures.target == "edges"
    sketch = result.curves.sketch(line_width(pictures.store) if drawn else DEFAULT_WIDTH)
    kinds = {kind.name.lower(): int((result.curves.kind == kind).sum()) for kind in Kind}
    bias = result.bias
    chosen = {
        "curves": kinds,
        "vertices": len(set(result.curves.vertex.flatten().tolist())),
        "bias_pixels": {"dx": bias.dx, "dy": bias.dy, "outward": bias.outward},
    }
    return Fitted(frame.to_world(sketch), pictures, chosen, losses, {}, stopped)
