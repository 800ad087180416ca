"""Time and peak memory of loading many posed pictures and building their pyramid: `python benchmarks/pictures.py`."""

import argparse
import math
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import torch
from PIL import Image

import diff3ds as ds
from diff3ds.pictures.dataset import load_posed
from diff3ds.pictures.pyramid import build_pyramid

# Views, (height, width), format, and the size they are reduced to.
CASES = (
    (1000, (512, 512), "png", 512),
    (1000, (2160, 3840), "jpg", 512),
    (50, (2160, 3840), "jpg", 3840),
)
DIFFERENT = 4
MB = 1e6


def main() -> None:
    """Measures every case in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=1000, help="at most so many views")
    parser.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure(Path(arguments.measure[0]), int(arguments.measure[1]))
        return
    print(
        "views  size       file  reduced to  pixels MB  load s  pyramid s  batch ms  peak RSS MB  of it not in a file"
    )
    for views, size, suffix, reduced in CASES:
        views = min(views, arguments.views)
        with tempfile.TemporaryDirectory() as folder:
            path = _scene(Path(folder), views, size, suffix)
            command = [sys.executable, __file__, "--measure", str(path), str(reduced)]
            row = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        print(f"{views:5}  {size[1]:4}x{size[0]:4}  {suffix:4}  {reduced:10}  {row}", end="", flush=True)


def _scene(folder: Path, views: int, size: tuple[int, int], suffix: str) -> Path:
    """A few coloured pictures, each of many views."""
    y, x = torch.meshgrid(*(torch.arange(n) / n for n in size), indexing="ij")
    for i in range(DIFFERENT):
        waves = [torch.sin((i + c + 2) * 9 * x) * torch.cos((i + 2 * c + 1) * 7 * y) for c in range(3)]
        picture = ((torch.stack(waves, -1) + 1) / 2 * 255).byte().numpy()
        Image.fromarray(picture).save(folder / f"{i}.{suffix}")
    cameras = ds.orbit([360 * i / views for i in range(views)], 20, 3.0, size=size)
    names = [f"{i % DIFFERENT}.{suffix}" for i in range(views)]
    ds.save_transforms(folder / "transforms.json", cameras, names)
    return folder / "transforms.json"


def _measure(path: Path, size: int) -> None:
    torch.set_num_threads(1)
    peak = [0.0]
    stop = threading.Event()
    watcher = threading.Thread(target=_watch, args=(peak, stop))
    watcher.start()
    begun = time.perf_counter()
    pictures = load_posed(path, "color", size, path.parent)
    loaded = time.perf_counter()
    pyramid = build_pyramid(pictures.cameras, pictures.store, 100, 5, 0)
    built = time.perf_counter()
    for step in range(90, 100):
        assert float(pyramid.targets(step).images.mean()) < 1
    batch = (time.perf_counter() - built) / 10
    stop.set()
    watcher.join()
    pixels = sum(math.prod(level.store.pixels.shape) for level in pyramid.levels) / MB
    times = f"{loaded - begun:6.1f}  {built - loaded:9.1f}  {1e3 * batch:8.1f}"
    print(f"{pixels:9.0f}  {times}  {_status('VmHWM') / MB:11.0f}  {peak[0] / MB:19.0f}")


def _watch(peak: list[float], stop: threading.Event) -> None:
    while not stop.wait(0.005):
        peak[0] = max(peak[0], _status("RssAnon"))


def _status(field: str) -> float:
    """Bytes, from the kernel's account of this process (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * float(next(line for line in lines if line.startswith(f"{field}:")).split()[1])


if __name__ == "__main__":
    main()
