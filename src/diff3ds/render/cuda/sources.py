"""The sources of the kernels: where they are, and which kernels they hold."""

import functools
import hashlib
import re
from pathlib import Path
from typing import NamedTuple

# Files in csrc/cuda, compiled apart from each other: those that every drawing of strokes needs, those of Monte Carlo
# alone, and those of filled and stroked layers.
DRAWING = ("pieces", "chords", "draw", "differentiate")
MONTE_CARLO = ("samples", "outlines")
AREAS = ("areas",)
PARTS = DRAWING + MONTE_CARLO + AREAS
SUFFIXES = (".cu", ".cuh", ".h")


class Kernel(NamedTuple):
    """The part that holds a kernel, and the threads of its blocks."""

    part: str
    threads: int


@functools.cache
def source_folder() -> Path:
    """The folder with the sources: beside the package's modules, or in a checkout's csrc.

    Raises:
        FileNotFoundError: they were not installed.
    """
    here = Path(__file__).resolve()
    places = [here.parents[2] / "csrc", here.parents[4] / "csrc"]
    for place in places:
        if (place / "cuda" / "draw.cu").is_file():
            return place
    raise FileNotFoundError(f"the sources of the CUDA kernels are missing: looked in {places[0]} and {places[1]}")


@functools.cache
def source_digest() -> str:
    """A digest of all that the kernels are compiled from."""
    digest = hashlib.sha256()
    folders = [source_folder() / name for name in ("common", "cuda")]
    for path in sorted(p for folder in folders for p in folder.rglob("*") if p.suffix in SUFFIXES):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@functools.cache
def kernels() -> dict[str, Kernel]:
    """All kernels by name, as their sources declare them: KERNEL(name, threads) and what else bounds them."""
    return {
        name: Kernel(part, int(threads))
        for part in PARTS
        for name, threads in re.findall(
            r"^KERNEL\((\w+), (\d+)\b", (source_folder() / "cuda" / f"{part}.cu").read_text(encoding="utf-8"), re.M
        )
    }
