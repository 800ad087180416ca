"""Damaged copies of a folder of posed pictures, to see what `diff3ds views` makes of them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageFilter

Frames = list[dict[str, Any]]
Change = Callable[[int, Image.Image, np.random.Generator], Image.Image]


def thinned_out(folder: Path, target: str, every: int, out: Path) -> Path:
    """The transforms file of a folder, or one of every so manieth view."""
    source = folder / ("transforms_edges.json" if target == "edges" else "transforms_color.json")
    if every == 1:
        return source
    data = json.loads(source.read_text())
    frames = [{**f, "file_path": str((source.parent / f["file_path"]).resolve())} for f in data["frames"][::every]]
    out.mkdir(parents=True, exist_ok=True)
    (out / "transforms.json").write_text(json.dumps({**data, "frames": frames}))
    return out / "transforms.json"


def damaged(name: str, folder: Path, target: str, out: Path) -> Path:
    """The transforms file of a copy with one kind of damage."""
    frames_of, change = DAMAGES[name]
    source = thinned_out(folder, target, 1, out)
    data = json.loads(source.read_text())
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    frames = []
    for i, frame in frames_of(list(enumerate(data["frames"])), rng):
        picture = change(i, Image.open(source.parent / frame["file_path"]), rng)
        picture.save(out / f"{i:03}.png")
        size = {"w": picture.width, "h": picture.height} if picture.width != data.get("w", picture.width) else {}
        scale = picture.width / data["w"] if size else 1.0
        lens = {k: data[k] * scale for k in ("fl_x", "fl_y", "cx", "cy") if k in data} if size else {}
        frames.append({**frame, "file_path": f"{i:03}.png", **size, **lens})
    (out / "transforms.json").write_text(json.dumps({**data, "frames": frames}))
    return out / "transforms.json"


def _all(frames: list[tuple[int, dict[str, Any]]], rng: np.random.Generator) -> list[tuple[int, dict[str, Any]]]:
    return frames


def _two_thirds(frames: list[tuple[int, dict[str, Any]]], rng: np.random.Generator) -> list[tuple[int, dict[str, Any]]]:
    return [frames[i] for i in sorted(rng.permutation(len(frames))[: 2 * len(frames) // 3])]


def _wrong_camera(
    frames: list[tuple[int, dict[str, Any]]], rng: np.random.Generator
) -> list[tuple[int, dict[str, Any]]]:
    """One view gets the pose of another."""
    (i, first), (_, second) = frames[3], frames[len(frames) // 2]
    frames[3] = (i, {**first, "transform_matrix": second["transform_matrix"]})
    return frames


def _same(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    return picture


def _blurred(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    return picture.filter(ImageFilter.GaussianBlur(1.5))


def _noisy(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    values = np.asarray(picture, np.float64)
    return Image.fromarray(np.clip(values + rng.normal(0, 25.5, values.shape), 0, 255).astype(np.uint8))


def _inverted(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    return Image.fromarray(255 - np.asarray(picture.convert("L")))


def _colored(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    """Edges in colour on black."""
    gray = np.asarray(picture.convert("L"), np.float64)[..., None]
    return Image.fromarray((gray * np.array([1.0, 0.75, 0.2])).astype(np.uint8))


def _stand(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    """The edges of a hand or a stand, at the same place of all pictures."""
    values = np.asarray(picture).copy()
    ink = 255 if values.ndim == 2 else np.array([90, 60, 40, 255][: values.shape[-1]])
    height, width = values.shape[:2]
    values[int(0.7 * height) :, int(0.46 * width) : int(0.465 * width) + 1] = ink
    values[int(0.7 * height) :, int(0.54 * width) : int(0.545 * width) + 1] = ink
    return Image.fromarray(values)


def _some_empty(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    return Image.fromarray(np.zeros_like(np.asarray(picture))) if i % 5 == 0 else picture


def _mixed_sizes(i: int, picture: Image.Image, rng: np.random.Generator) -> Image.Image:
    scale = (1.0, 0.75, 1.5)[i % 3]
    return picture.resize((round(picture.width * scale), round(picture.height * scale)), Image.Resampling.BICUBIC)


# By name: which frames, and what happens to each picture.
DAMAGES: dict[str, tuple[Callable[..., list[tuple[int, dict[str, Any]]]], Change]] = {
    "none": (_all, _same),
    "third dropped": (_two_thirds, _same),
    "wrong camera": (_wrong_camera, _same),
    "blurred": (_all, _blurred),
    "noise 10 %": (_all, _noisy),
    "black on white": (_all, _inverted),
    "in colour": (_all, _colored),
    "a stand": (_all, _stand),
    "some empty": (_all, _some_empty),
    "mixed sizes": (_all, _mixed_sizes),
}
