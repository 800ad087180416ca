"""A sheet of the sketches of a batch: one small picture of each, with its name."""

from collections.abc import Sequence
from pathlib import Path

import torch
from PIL import Image, ImageDraw

from diff3ds._files import replacing
from diff3ds.formats import load
from diff3ds.formats.framing import framed
from diff3ds.render import render
from diff3ds.tasks.batch.job_file import Job

# Pixels of a picture, and of the line below it; pictures in a row, and on the sheet: of more jobs, evenly spaced ones.
SIZE, LINE, COLUMNS, MOST = 160, 14, 8, 96
# From where sketches are seen, degrees.
AZIMUTH, ELEVATION = 30.0, 20.0


def write_sheet(out: Path, jobs: Sequence[Job]) -> int:
    """Writes sheet.png, with the sketches of jobs that are done.

    Returns:
        How many there are on it.
    """
    count = min(len(jobs), MOST)
    shown = [jobs[i * len(jobs) // count] for i in range(count)]
    rows = -(-count // COLUMNS)
    sheet = Image.new("RGB", (min(count, COLUMNS) * SIZE, rows * (SIZE + LINE)), "white")
    draw = ImageDraw.Draw(sheet)
    for number, job in enumerate(shown):
        x, y = number % COLUMNS * SIZE, number // COLUMNS * (SIZE + LINE)
        sheet.paste(_picture(out / job.name / "sketch.json"), (x, y))
        draw.text((x + 4, y + SIZE), job.name.rpartition("/")[2][: SIZE // 6 - 1], fill="black")
    with replacing(out / "sheet.png") as temporary:
        sheet.save(temporary, format="png")
    return count


def _picture(path: Path) -> Image.Image:
    sketch = load(path)
    color = render(sketch, framed(sketch, AZIMUTH, ELEVATION, size=SIZE).to(sketch.points.dtype)).color[0]
    return Image.fromarray((color.detach().clamp(0, 1) * 255).round().to(torch.uint8).numpy())
