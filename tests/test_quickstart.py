"""The quickstart notebook: it runs with a wheel in an environment of its own, and shows what it says."""

import base64
import io
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[1]
NOTEBOOK = ROOT / "docs/start/quickstart.ipynb"
# Headings of the sections, in their order, and how many pictures each shows.
SHOWN = {"A phrase": 1, "A drawing": 1, "Pictures from all sides": 1, "A mesh": 1, "A loss of your own": 1}


def sections(path):
    """The code cells of a notebook by the heading above them."""
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    found, heading = {}, ""
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "markdown":
            heading = (re.findall(r"^## (.*)$", cell.source, re.MULTILINE) or [heading])[0]
        else:
            found.setdefault(heading, []).append(cell)
    return found


def check_outputs(path):
    """Each section shows its pictures, with ink, and says figures that are right."""
    found = sections(path)
    outputs = {heading: [output for cell in cells for output in cell.outputs] for heading, cells in found.items()}
    assert not [output for each in outputs.values() for output in each if output.output_type == "error"]
    said = {heading: "".join(output.get("text", "") for output in each) for heading, each in outputs.items()}
    for heading, count in SHOWN.items():
        pictures = [output.data["image/png"] for output in outputs[heading] if "image/png" in output.get("data", {})]
        assert len(pictures) == count
        for picture in pictures:
            pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))).convert("L"))
            assert 0.005 < (pixels < 200).mean() < 0.5
    assert 10 < int(re.search(r"(\d+) strokes", said["A phrase"])[1]) < 80
    assert said["A drawing"].startswith("mug, seen from azimuth ")
    # Eight lines, and two rings and a seat that are whole circles.
    assert said["Pictures from all sides"].startswith("11 curves")
    # Two triangles and the three edges between them.
    assert said["A mesh"] == "9 edges\n"
    first, last = map(float, re.findall(r"\d\.\d+", said["A loss of your own"]))
    assert last < first / 2
    assert re.fullmatch(r"stool.step \d+ kB\nchair.svg \d+ kB\nchair.html \d+ kB\n", said["Leave with it"])
    (widget,) = (output for output in outputs["Turn it here"] if "data" in output)
    assert widget.data["text/plain"].startswith("(a widget")


def test_what_is_kept_of_it_is_whole_and_small():
    check_outputs(NOTEBOOK)
    assert NOTEBOOK.stat().st_size < 300_000
    # The links of its text, which the tests of documents do not see.
    for link in re.findall(r"\]\(([\w./-]+)\)", NOTEBOOK.read_text(encoding="utf-8")):
        assert (NOTEBOOK.parent / link).is_file() or link == "../reference/python.md"


@pytest.mark.slow
def test_it_runs_with_a_wheel_in_an_environment_of_its_own(tmp_path):
    """Other packages are those of the environment of the tests: to load PyTorch again would take gigabytes."""
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    pip, env = [sys.executable, "-m", "pip"], tmp_path / "env"
    subprocess.run([*pip, "wheel", "-q", "--no-deps", "-w", tmp_path, ROOT], check=True, timeout=1800)
    (wheel,) = tmp_path.glob("diff3ds-*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", env], check=True, timeout=300)
    python = env / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    subprocess.run([*pip, "--python", python, "install", "-q", "--no-deps", wheel], check=True, timeout=300)
    where = "import sysconfig; print(sysconfig.get_path('purelib'))"
    own = Path(subprocess.run([python, "-c", where], capture_output=True, text=True, check=True).stdout.strip())
    # Only names a place where modules are: what lies there to make a checkout importable does nothing.
    (own / "others.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    where = "import diff3ds, diff3ds._kernels as k; print(diff3ds.__file__, k.__file__, sep='\\n')"
    told = subprocess.run([python, "-c", where], capture_output=True, text=True, check=True, cwd=tmp_path).stdout
    assert all(Path(line).is_relative_to(own) for line in told.split("\n") if line)
    done = tmp_path / "done.ipynb"
    run = [python, ROOT / "benchmarks/notebook.py", NOTEBOOK, "-o", done]
    subprocess.run(run, check=True, timeout=1800, cwd=tmp_path)
    check_outputs(done)
