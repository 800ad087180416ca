"""The numbers in a picture file as shares of white, whatever their kind; and what is wrong with other files."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor

# Filters that reduce pictures of floating point numbers may reach so far beyond black and white.
OVERSHOOT = 0.01
FORMATS = "save it as PNG or TIFF with 8 or 16 bits a channel"
# TIFF's tags of how numbers are stored, and its names of their formats.
BITS, CHANNELS, SAMPLE_FORMAT = 258, 277, 339
SAMPLE_FORMATS = {1: "whole", 2: "signed whole", 3: "floating point", 5: "complex", 6: "complex floating point"}
TIFF = (b"II*\0", b"MM\0*")
# Pictures as phones take them, and those of them that pillow reads here.
HEIC = (".heic", ".heif")
HEIC_READ = HEIC if importlib.util.find_spec("pillow_heif") else ()
HEIC_ADVICE = "pip install 'diff3ds[heic]', or save them as JPEG"


# What files are that hold pictures in another way, by their first bytes or by the brand of an ISO container.
FILM = "it is a film: take a frame of it, such as ffmpeg -i clip.mp4 -vf fps=2 frames/%04d.jpg writes, two a second"
VECTORS = "it is a vector drawing: an SVG file is read by its name, mug.svg; else save it as PNG"
_BRANDS = {
    **dict.fromkeys((b"hei", b"hev", b"mif", b"msf"), f"it is a HEIC picture: name it .heic, and {HEIC_ADVICE}"),
    b"avi": "it is an AVIF picture, which needs pillow 11.3 or newer: pip install -U pillow, or save it as PNG",
}
_OTHERS = {
    b"%PDF": "it is a PDF document: save the page that is meant as PNG or SVG",
    b"%!PS": "it is a PostScript drawing: save it as PNG or SVG",
    b"<svg": VECTORS,
    b"<?xml": VECTORS,
    b"<!DOCTYPE svg": VECTORS,
    b"\x1f\x8b": "it is compressed by gzip, as .svgz files are: save it as PNG or SVG",
    b"\x1aE\xdf\xa3": FILM,
    b"8BPS": "it is a Photoshop file that pillow does not read: save it as PNG",
    b"gimp xcf": "it is a GIMP file: export it as PNG",
    b"PK\x03\x04": "it is a ZIP archive, such as painting programs write: export the picture as PNG",
}


def prepare(path: Path) -> None:
    """Has pillow read HEIC, if the file is such a picture.

    Raises:
        ValueError: pillow-heif is not installed.
    """
    if path.suffix.lower() in HEIC:
        if not HEIC_READ:
            raise ValueError(f"{path}: HEIC pictures are not read: {HEIC_ADVICE}")
        import pillow_heif

        pillow_heif.register_heif_opener()


def pixels_of(picture: Any) -> Float[Tensor, "H W C"]:
    """An open picture as float32 in [0, 1]: gray, RGB or straight RGBA.

    Raises:
        ValueError: numbers whose black and white are not told.
    """
    if picture.mode == "F":
        return _unit(np.asarray(picture))[..., None]
    if picture.mode.startswith("I"):
        return _of_whole_numbers(picture)
    transparent = "A" in picture.getbands() or "transparency" in picture.info
    if picture.mode not in ("L", "RGB", "RGBA") or (transparent and picture.mode != "RGBA"):
        picture = picture.convert("L" if picture.mode == "1" else "RGBA" if transparent else "RGB")
    values = torch.from_numpy(np.asarray(picture).astype(np.float32)) / 255
    return values[..., None] if values.ndim == 2 else values


def _unit(values: Any) -> Float[Tensor, "H W"]:
    """Floating point numbers that lie in [0, 1]."""
    finite = np.isfinite(values)
    if not finite.all():
        raise ValueError(f"{(~finite).sum()} of its {finite.size} numbers are NaN or infinite: {FORMATS}")
    low, high = float(values.min()), float(values.max())
    if low < -OVERSHOOT or high > 1 + OVERSHOOT:
        raise ValueError(
            f"floating point numbers from {low:g} to {high:g}, but 0 is black and 1 is white: scale them, or {FORMATS}"
        )
    return torch.from_numpy(values.astype(np.float32)).clamp_(0, 1)


def _of_whole_numbers(picture: Any) -> Float[Tensor, "H W C"]:
    """Gray of 16 bits, with alpha where one value is transparent."""
    values = np.asarray(picture)
    # Of PNG and PPM files some versions of pillow make 32 bits of the 16 that are there.
    if picture.mode == "I" and picture.format not in ("PNG", "PPM"):
        bits = getattr(picture, "tag_v2", {}).get(BITS, (32,))[0]
        signed = "signed " if getattr(picture, "tag_v2", {}).get(SAMPLE_FORMAT, (2,))[0] == 2 else ""
        raise ValueError(
            f"{signed}whole numbers of {bits} bits, from {values.min()} to {values.max()}, and it is not told which of "
            f"them is white: {FORMATS}"
        )
    gray = torch.from_numpy(values.astype(np.float32))[..., None] / 65535
    clear = picture.info.get("transparency")
    if not isinstance(clear, int):
        return gray
    alpha = torch.from_numpy((values != clear).astype(np.float32))[..., None]
    return torch.cat([gray.expand(-1, -1, 3), alpha], -1)


def require_one_frame(picture: Any) -> None:
    """Checks that a file holds one picture, which smaller ones, as in pyramids, those of phones, or layers may follow.

    Raises:
        ValueError: an animation, or pages of one size.
    """
    if picture.format in ("MPO", "PSD") or not getattr(picture, "is_animated", False):
        return
    count, size = picture.n_frames, picture.size
    if picture.format == "TIFF":
        picture.seek(1)
        second = picture.size
        picture.seek(0)
        if second != size:
            return
    what = "pages" if picture.format == "TIFF" else "frames of an animation"
    raise ValueError(f"it holds {count} {what}: save the one that is meant as a file of its own")


def described(path: Path) -> str:
    """What a file is that pillow does not know."""
    with path.open("rb") as file:
        start = file.read(64)
    if not start:
        return "the file is empty"
    if start.startswith(b"version https://git-lfs"):
        return "it is a pointer of Git LFS: get the picture itself with git lfs pull"
    if start[:4] in TIFF:
        return _described_tiff(path)
    if start[4:8] == b"ftyp":
        return _BRANDS.get(start[8:11], FILM)
    for beginning, what in _OTHERS.items():
        if start.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(beginning):
            return what
    return f"it begins with {start[:12]!r}, as no kind of picture that pillow reads"


def _described_tiff(path: Path) -> str:
    """How the numbers of a TIFF file are stored that pillow does not read."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    try:
        with path.open("rb") as file:
            header = file.read(8)
            tags = ImageFileDirectory_v2(header)
            file.seek(tags.next)
            tags.load(file)
        bits, channels = tags.get(BITS, (1,)), tags.get(CHANNELS, 1)
        kind = SAMPLE_FORMATS.get(tags.get(SAMPLE_FORMAT, (1,))[0], "other")
    # Broken files make pillow's readers raise nearly anything.
    except Exception as error:
        return f"a broken TIFF file: {error}"
    return f"{channels} channels of {kind} numbers of {bits[0]} bits in a TIFF file are not read: {FORMATS}"
