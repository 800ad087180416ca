"""How the time and memory of each job grow with its size, from a usual one to a hundred times that.

    python benchmarks/growth.py [--only render mesh ...] [--limit 600] [--json FILE]

Each figure is a command that a user would give, in a process of its own: seconds of all its threads on the processor,
which other work on the machine changes little, seconds on the clock, and its largest memory. The exponent is the slope
of log processor seconds, less those of a picture of one stroke (mostly PyTorch's own start), over log size between the
two largest sizes that end within the limit; nothing larger is tried after one that does not.
"""

import argparse
import json
import math
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from cad_objects import generate
from report import environment, show, write_json
from workloads import Workload, scene

import diff3ds as ds

LIMIT = 600
# Processor seconds beyond the start, below which its own spread is what is measured; empirical.
NOISE = 0.3
# Of the largest memory of a process that has ended, in kB but on macOS.
UNIT = 1 if sys.platform == "darwin" else 1024
# Runs a command from a small process: the memory of the one that it is started by counts as the command's.
WATCH = """
import json, resource, subprocess, sys, time
limit, *program = sys.argv[1:]
resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit)))
begun = time.perf_counter()
done = subprocess.run(program, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
clock, used = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
processor = used.ru_utime + used.ru_stime
print(json.dumps(dict(code=done.returncode, error=done.stderr, processor=processor, clock=clock, most=used.ru_maxrss)))
"""


class Job(NamedTuple):
    """A command, what its size counts, the sizes, and what makes the input of one size in a folder."""

    over: str
    sizes: tuple[int, ...]
    command: Callable[[int, Path], list[str]]


def _strokes(count: int, folder: Path) -> str:
    path = folder / "strokes.json"
    ds.save(path, scene(Workload(count, 1, (512, 512)))[0])
    return str(path)


def _render(count: int, folder: Path) -> list[str]:
    return ["render", _strokes(count, folder), "-o", str(folder / "out.png")]


def _render_pixels(count: int, folder: Path) -> list[str]:
    return ["render", _strokes(100, folder), "-o", str(folder / "out.png"), "--size", str(math.isqrt(count))]


def _ink(count: int, folder: Path) -> list[str]:
    return ["render", _strokes(count, folder), "-o", str(folder / "out.svg"), "--style", "ink"]


def _frames(count: int, folder: Path) -> list[str]:
    return ["render", _strokes(100, folder), "-o", str(folder / "out.webp"), "--turntable", str(count)]


def _export(suffix: str) -> Callable[[int, Path], list[str]]:
    return lambda count, folder: ["export", _strokes(count, folder), str(folder / f"out{suffix}")]


def _boxes(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners and triangles of boxes that do not touch, in a square on the ground."""
    corners = np.array([[x, y, z] for x in (0, 0.7) for y in (0, 0.7) for z in (0, 0.7)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([(a, b, c) for a, b, c, _ in sides] + [(a, c, d) for a, _, c, d in sides])
    side = math.ceil(math.sqrt(count))
    places = np.array([[i % side, i // side, 0] for i in range(count)], float)
    return (places[:, None] + corners).reshape(-1, 3), (8 * np.arange(count)[:, None, None] + triangles).reshape(-1, 3)


def _ball(count: int) -> tuple[np.ndarray, np.ndarray]:
    """A ball with waves, of nearly so many triangles."""
    rows = round(math.sqrt(count / 4))
    turn, rise = np.meshgrid(np.arange(2 * rows) * np.pi / rows, (np.arange(rows) + 0.5) * np.pi / rows - np.pi / 2)
    away = 1 + 0.1 * np.cos(3 * turn) * np.cos(rise) ** 2
    points = away[..., None] * np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], -1)
    at = np.arange(2 * rows * rows).reshape(rows, 2 * rows)
    here, beside = at, np.roll(at, -1, 1)
    sides = [here[:-1], beside[:-1], beside[1:]], [here[:-1], beside[1:], here[1:]]
    ends = [(*at[0, ::-1],), (*at[-1],)]
    caps = [(loop[0], loop[i], loop[i + 1]) for loop in ends for i in range(1, 2 * rows - 1)]
    return points.reshape(-1, 3), np.concatenate([np.stack(s, -1).reshape(-1, 3) for s in sides] + [np.array(caps)])


def _mesh(made: tuple[np.ndarray, np.ndarray], folder: Path) -> list[str]:
    path = folder / "mesh.obj"
    with path.open("w") as file:
        np.savetxt(file, made[0], "v %.9g %.9g %.9g")
        np.savetxt(file, made[1] + 1, "f %d %d %d")
    return ["mesh", str(path), "-o", str(folder / "out")]


def _points(count: int, folder: Path) -> list[str]:
    """Three boxes of which points are all over."""
    g = np.random.default_rng(0)
    points = g.random((count, 3))
    axis = g.integers(3, size=count)
    points[np.arange(count), axis] = g.integers(2, size=count)
    box = g.integers(3, size=count)
    sizes, places = np.array([[2, 1, 0.3], [0.5, 1, 1], [0.4, 0.4, 0.8]]), np.array([[0, 0, 0], [0, 2, 0], [2.5, 0, 0]])
    path = folder / "cloud.npy"
    np.save(path, (points * sizes[box] + places[box]).astype(np.float32))
    return ["points", str(path), "-o", str(folder / "out")]


def _views(count: int, folder: Path) -> list[str]:
    generate(0, folder / "views", clean=True, views=count)
    return ["views", str(next((folder / "views").rglob("transforms*.json"))), "-o", str(folder / "out")]


def _text(steps: int, folder: Path) -> list[str]:
    return ["text", "a chair", "--steps", str(steps), "-o", str(folder / "out")]


JOBS = {
    "render": Job("strokes", (100, 1_000, 10_000), _render),
    "render, larger": Job("pixels", (512**2, 1_600**2, 5_120**2), _render_pixels),
    "render, ink": Job("strokes", (30, 300, 3_000), _ink),
    "render, turntable": Job("frames", (24, 240, 2_400), _frames),
    "export, STEP": Job("strokes", (100, 1_000, 10_000), _export(".step")),
    "export, page": Job("strokes", (100, 1_000, 10_000), _export(".html")),
    "mesh, finer": Job("faces", (3_000, 30_000, 300_000), lambda n, folder: _mesh(_ball(n), folder)),
    "mesh, more boxes": Job("faces", (120, 1_200, 12_000), lambda n, folder: _mesh(_boxes(n // 12), folder)),
    "points": Job("points", (30_000, 300_000, 3_000_000), _points),
    "views": Job("views", (10, 100), _views),
    "text": Job("steps", (40, 400, 4_000), _text),
}


def measure(arguments: list[str], limit: int) -> dict[str, float] | None:
    """Seconds on the processor and on the clock and MB of a command; None where the limit ends it."""
    program = [sys.executable, "-c", "from diff3ds._start import main; main()", *arguments, "--quiet"]
    watched = [sys.executable, "-IS", "-c", WATCH, str(limit), *program]
    said = json.loads(subprocess.run(watched, capture_output=True, text=True, check=True).stdout)
    if said["code"] in (-signal.SIGXCPU, -signal.SIGKILL):
        return None
    if said["code"]:
        raise RuntimeError(f"diff3ds {' '.join(arguments)}: {said['error']}")
    return {"processor": said["processor"], "clock": said["clock"], "mb": said["most"] * UNIT / 1e6}


def exponent(sizes: list[int], seconds: list[float]) -> float | None:
    """The slope between the last two, of their logarithms; None of less than two, or where the first hides in noise."""
    if len(sizes) < 2 or min(seconds[-2:]) < NOISE:
        return None
    return math.log(seconds[-1] / seconds[-2]) / math.log(sizes[-1] / sizes[-2])


def grown(job: Job, start: float, limit: int) -> dict[str, Any]:
    """Figures of one job at its sizes."""
    rows: list[dict[str, float]] = []
    for size in job.sizes:
        with tempfile.TemporaryDirectory() as folder:
            figures = measure(job.command(size, Path(folder)), limit)
        if figures is None:
            break
        rows.append({"size": size, **figures})
    seconds = [row["processor"] - start for row in rows]
    sizes = [int(row["size"]) for row in rows]
    return {"over": job.over, "sizes": job.sizes, "rows": rows, "exponent": exponent(sizes, seconds)}


def main() -> None:
    """Runs the jobs, and prints a row for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=JOBS, default=list(JOBS))
    parser.add_argument("--limit", type=int, default=LIMIT, help="seconds on the processor for a command")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        first = measure(_render(1, Path(folder)), chosen.limit)
        assert first is not None
    figures: dict[str, Any] = {"limit": chosen.limit, "start": first, "jobs": {}}
    for name in chosen.only:
        made = figures["jobs"][name] = grown(JOBS[name], first["processor"], chosen.limit)
        print(name, json.dumps(made), flush=True)
        if chosen.json:
            write_json(chosen.json, environment(), figures)
    rows = [
        [name, job["over"], *(f"{r['size']:,}: {r['processor']:.1f} s, {r['mb']:.0f} MB" for r in job["rows"]),
         *["-"] * (3 - len(job["rows"])), job["exponent"]]
        for name, job in figures["jobs"].items()
    ]  # fmt: skip
    show("Growth", ["job", "over", "usual", "10 times", "100 times", "exponent"], rows)


if __name__ == "__main__":
    main()
