"""Photographs to cameras by pycolmap, which works in a process of its own on reduced copies of them."""

import importlib.util
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.formats.png import save_png, size_of
from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.photogrammetry import colmap_process
from diff3ds.photogrammetry.picture_files import masks_for
from diff3ds.photogrammetry.programs import colmap
from diff3ds.pictures.dataset import reduced
from diff3ds.pictures.reading.decoded_once import at_a_time, load_once
from diff3ds.render.backends import get_num_threads, torch_on_one_thread
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.progress import Progress, Report
from diff3ds.transforms import View

# Of more pictures, all pairs take long: a hundred are 5,000 pairs, some seconds each ten. [empirical]
MOST_PAIRED = 60
# [ratio, ratio; empirical] All cameras are adjusted at once each time that there are a tenth more of them, and of more
# than `MOST_PAIRED` three tenths: of 200 the reprojection error is the same, .59 pixels, in 110 s instead of 155.
OFTEN, SELDOM = 1.1, 1.3
# In a sequence each picture is compared with so many that follow it, and with those 2, 4, 8 and so on times farther.
NEIGHBOURS = 8
# Of the photographs: fewer that are placed are said to be a failure, and what to do. [empirical]
ENOUGH = 0.8
FEWEST = 3
ADVICE = (
    "What helps: photographs that overlap by two thirds; --order any; --size 2048 --features 8000; texture on "
    "the table below the thing (a newspaper); where the thing turns before a fixed camera, a folder 'masks'"
)
# EXIF: its folder, and the focal length for film of 35 mm.
TAG_EXIF, TAG_FOCAL_35 = 0x8769, 0xA405
FILM = 36.0  # mm, the longer side of the film that such focal lengths are given for


@dataclass(frozen=True, eq=False)
class Registered:
    """Views, and what is said about them.

    Attributes:
        views: in COLMAP's world, whose scale is arbitrary.
        points: found with them.
        about: registered, reprojection error and so on, for a file.
        lines: for people.
    """

    views: list[View]
    points: Float[Tensor, "P 3"]
    about: dict[str, Any]
    lines: list[str]


def register(
    pictures: list[Path],
    options: RegistrationOptions,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Registered:
    """The cameras of photographs, as far as they can be found.

    Args:
        pictures: at least three, in their order.
        options: of the command.
        report: called as it goes on.
        say: called with what is done, and how long it will take.

    Raises:
        ImportError: pycolmap is not installed.
        ValueError: fewer than three pictures; no two of them fit together.
    """
    if importlib.util.find_spec("pycolmap") is None:
        raise ImportError('finding cameras of photographs needs pycolmap: pip install "diff3ds[cameras]"')
    if len(pictures) < FEWEST:
        raise ValueError(f"{pictures[0].parent}: cameras need at least {FEWEST} photographs, got {len(pictures)}")
    sizes = [size_of(picture) for picture in pictures]
    with tempfile.TemporaryDirectory(prefix="diff3ds-") as scratch:
        place = Path(scratch)
        # Torch's own threads wait for each other busily, which takes the time of others.
        with torch_on_one_thread():
            names = _reduced(pictures, sizes, place / "pictures", options.size, report)
            masks = _reduced_masks(pictures, names, place)
        pairs = list(_pairs(names, pictures, options))
        how = "all pairs" if len(pairs) == len(names) * (len(names) - 1) // 2 else "each with those that follow it"
        say(f"{len(pictures)} photographs, {how}: {len(pairs)} pairs to compare")
        focal = _focal_of(pictures[0], size_of(place / "pictures" / names[0])) if len(set(sizes)) == 1 else None
        job = {
            "database": str(place / "database.db"),
            "pictures": str(place / "pictures"),
            "masks": str(masks) if masks else "",
            "out": str(place),
            "names": names,
            "pairs": pairs,
            "threads": get_num_threads(),
            "features": options.features,
            "camera_model": "SIMPLE_RADIAL",
            "parameters": focal or [],
            "one_camera": len(set(sizes)) == 1,
            "again": SELDOM if len(names) > MOST_PAIRED else OFTEN,
        }
        (place / "job.json").write_text(json.dumps(job), encoding="utf-8")
        models = _process(place / "job.json", report, say)
        if not models:
            raise ValueError(f"{pictures[0].parent}: no two photographs fit together. {ADVICE}")
        best = max(models, key=lambda model: int(model["registered"]))
        shots, points = colmap.read_model(Path(best["folder"])), colmap.read_points(Path(best["folder"]))
    by_name = dict(zip(names, zip(pictures, sizes, strict=True), strict=True))
    views = []
    for shot in shots:
        picture, size = by_name[shot.name]
        assert shot.size is not None
        scale = shot.intrinsics.new_tensor([size[1] / shot.size[1], size[0] / shot.size[0], 1.0])
        views.append(View(picture, None, size, shot.world_to_camera, shot.intrinsics * scale[:, None], shot.distortion))
    return Registered(views, points, *_about(pictures, views, models, best, len(points)))


def _about(
    pictures: list[Path], views: list[View], models: list[dict[str, Any]], best: dict[str, Any], points: int
) -> tuple[dict[str, Any], list[str]]:
    """For the report and for people."""
    focal = float(torch.stack([view.intrinsics[0, 0] for view in views]).median())
    error = float(best["reprojection_error"])
    placed = {view.picture for view in views}
    left_out = [picture.name for picture in pictures if picture not in placed]
    about = {
        "registered": len(views), "photographs": len(pictures), "reprojection_error_px": error,
        "focal_length_px": focal, "points": points, "left_out": left_out,
        "models": sorted((int(model["registered"]) for model in models), reverse=True),
    }  # fmt: skip
    lines = [
        f"{len(views)} of {len(pictures)} photographs placed, reprojection error {error:.2f} px of the reduced "
        f"pictures, focal length {focal:.0f} px, {points} points"
    ]
    if len(views) < ENOUGH * len(pictures):
        parts = ", ".join(map(str, about["models"]))  # type: ignore[call-overload]
        lines.append(f"the photographs fall apart into groups of {parts}: the largest is kept. {ADVICE}")
    return about, lines


def _reduced(pictures: list[Path], sizes: list[tuple[int, int]], folder: Path, size: int, report: Report) -> list[str]:
    """Gray copies, several read at a time; returns their names, which sort as the pictures do."""
    folder.mkdir(parents=True)
    names = [f"{i:05d}.png" for i in range(len(pictures))]

    small = [reduced(full, size) for full in sizes]

    def told(done: int) -> None:
        report(Progress("read photographs", done, len(pictures), None, 0))

    def reduce(i: int) -> None:
        save_png(folder / names[i], _gray(pictures[i], small[i]))

    told(0)
    side_by_side(reduce, len(pictures), at_a_time(zip(pictures, sizes, small, strict=True)), told)
    return names


def _gray(picture: Path, size: tuple[int, int]) -> torch.Tensor:
    """A picture over white, in gray, by area means.

    JPEG files are decoded at no less than this size: decoded at no less than twice of it, whose means hide what their
    reduced decoding does differently, eleven photographs of a castle are placed with .39 pixels of error, and so .41.
    """
    image, _, _ = load_once(picture, size)
    clear = 1 - image[..., 3:] if image.shape[2] == 4 else image.new_zeros(())
    gray = image[..., :3].mean(-1, keepdim=True) * (1 - clear) + clear
    small = torch.nn.functional.interpolate(gray.permute(2, 0, 1)[None], size, mode="area")
    return small[0].permute(1, 2, 0)


def _reduced_masks(pictures: list[Path], names: list[str], place: Path) -> Path | None:
    """Copies of masks, black where no features are looked for, by COLMAP's names."""
    masks = masks_for(pictures, pictures[0].parent)
    if masks is None:
        return None
    (place / "masks").mkdir()
    for name, mask in zip(names, masks, strict=True):
        if mask is not None:
            gray = _gray(mask, size_of(place / "pictures" / name))
            save_png(place / "masks" / f"{name}.png", (gray > 0.5 * gray.max()).float())
    return place / "masks"


def _pairs(names: list[str], pictures: list[Path], options: RegistrationOptions) -> Iterator[tuple[str, str]]:
    """Which pictures are compared. A sequence is taken for closed: those of a turntable are."""
    numbered = all(re.search(r"[0-9]+$", picture.stem) for picture in pictures)
    count = len(names)
    if options.order == "any" or (options.order == "auto" and not (numbered and count > MOST_PAIRED)):
        yield from ((names[i], names[j]) for i in range(count) for j in range(i + 1, count))
        return
    steps = [*range(1, NEIGHBOURS + 1)]
    while steps[-1] * 2 < count / 2:
        steps.append(steps[-1] * 2)
    # As people number them: 10 comes after 9.
    order = sorted(range(count), key=lambda i: _by_number(pictures[i]))
    seen = {tuple(sorted((order[i], order[(i + step) % count]))) for i in range(count) for step in steps}
    yield from ((names[i], names[j]) for i, j in sorted(seen) if i != j)


def _by_number(picture: Path) -> list[str | int]:
    """Sorts names with the numbers in them by these."""
    return [int(part) if i % 2 else part for i, part in enumerate(re.split(r"([0-9]+)", str(picture)))]


def _focal_of(picture: Path, size: tuple[int, int]) -> list[float] | None:
    """COLMAP's parameters for a focal length that EXIF gives for film."""
    from PIL import Image

    # Damaged EXIF makes pillow raise nearly anything; then there is none.
    try:
        with Image.open(picture) as image:
            focal = float(image.getexif().get_ifd(TAG_EXIF).get(TAG_FOCAL_35, 0))
    except Exception:
        return None
    return [focal / FILM * max(size), size[1] / 2, size[0] / 2, 0.0] if 8 <= focal <= 1000 else None


def _process(job: Path, report: Report, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """What the process answers, with its progress reported on the way.

    Raises:
        ValueError: it failed.
    """
    script = Path(colmap_process.__file__)
    log = job.with_name("log.txt")
    with log.open("w", encoding="utf-8") as errors:
        child = subprocess.Popen(
            [sys.executable, "-P", str(script), str(job)], stdout=subprocess.PIPE, stderr=errors, text=True
        )
        assert child.stdout is not None
        try:
            answer = _followed(child.stdout, report, say)
        finally:
            # After Ctrl-C: its C++ does not hear of that.
            child.kill()
            child.wait()
            child.stdout.close()
    if "models" in answer:
        models: list[dict[str, Any]] = answer["models"]
        return models
    last = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1:]
    raise ValueError(f"pycolmap failed: {answer.get('error') or ' '.join(last) or 'no answer'}")


def _followed(lines: Iterable[str], report: Report, say: Callable[[str], None]) -> dict[str, Any]:
    """The last line, after those of the progress; an estimate after the first tenth of the comparisons."""
    begun: dict[str, float] = {}
    told = False
    for line in lines:
        answer: dict[str, Any] = json.loads(line)
        if "stage" not in answer:
            return answer
        stage, done, total = answer["stage"], int(answer["done"]), int(answer["total"])
        report(Progress(stage, done, total, None, 0))
        since = begun.setdefault(stage, time.monotonic())
        if stage == "matches" and not told and total >= 10 and total > done >= total / 10:
            told = True
            left = (time.monotonic() - since) / done * (total - done)
            say(f"comparing photographs: about {max(1, round(left / 60))} min left, then the cameras")
    return {}
