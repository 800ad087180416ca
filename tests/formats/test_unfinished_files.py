"""Exports on a full disk, and interrupted ones: the old file stays as it is, and nothing is left beside it."""

import importlib.util
import json
import subprocess
import sys

import pytest

from diff3ds import _files

PACKAGES = {".dxf": "ezdxf", ".3dm": "rhino3dm", ".usda": "pxr"}
SUFFIXES = [
    s
    for s in (".json", ".step", ".dxf", ".3dm", ".usda", ".glb", ".ply", ".obj", ".svg", ".pdf", ".png", ".py")
    if s not in PACKAGES or importlib.util.find_spec(PACKAGES[s])
]
# What both do in a process of their own: old files, and a sketch that takes a while.
HEAD = """
import json, resource, signal, sys, time
from pathlib import Path
import torch
import diff3ds as ds

folder, suffixes = Path(sys.argv[1]), sys.argv[2].split()
g = torch.Generator().manual_seed(0)
sketch = ds.Sketch(torch.rand(20, 4, 3, generator=g), color=torch.rand(20, 3, generator=g), width=0.01)
torch.set_num_threads(1)
cameras = ds.orbit(30.0, 20.0, size=128)
said = {}
for suffix in suffixes:
    (folder / f"old{suffix}").write_text("old")
"""
FULL = """
# What is written beyond this fails, as it does on a full disk.
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (500, resource.RLIM_INFINITY))
for suffix in suffixes:
    try:
        ds.save(folder / f"old{suffix}", sketch, cameras)
        said[suffix] = "written"
    except OSError as error:
        said[suffix] = type(error).__name__
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
print(json.dumps(said))
"""
INTERRUPTED = """
for suffix in suffixes:
    # Of the same name, which STEP files hold.
    other = folder / "other" / f"old{suffix}"
    ds.save(other, sketch, cameras)
    start = time.perf_counter()
    ds.save(other, sketch, cameras)
    took = time.perf_counter() - start
    said[suffix] = "none"
    for share in (0.3, 0.6, 0.9):
        try:
            signal.setitimer(signal.ITIMER_REAL, max(share * took, 1e-4))
            ds.save(folder / f"old{suffix}", sketch, cameras)
            signal.setitimer(signal.ITIMER_REAL, 0)
        except KeyboardInterrupt:
            said[suffix] = "interrupted"
        # Files of DXF and 3DM hold the time and numbers by chance.
        content, dated = (folder / f"old{suffix}").read_bytes(), suffix in (".dxf", ".3dm")
        if content not in (b"old", other.read_bytes()) and not (dated and len(ds.load(folder / f"old{suffix}")) == 20):
            said[suffix] = "broken"
    other.unlink()
    (folder / f"old{suffix}").write_text("old")
other.parent.rmdir()
print(json.dumps(said))
"""


def run(tmp_path, code):
    command = [sys.executable, "-c", HEAD + code, str(tmp_path), " ".join(SUFFIXES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def check_old(tmp_path):
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(f"old{suffix}" for suffix in SUFFIXES)
    assert {p.read_text() for p in tmp_path.iterdir()} == {"old"}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of files are POSIX")
def test_a_full_disk_leaves_the_old_file(tmp_path):
    said = run(tmp_path, FULL)
    assert said == dict.fromkeys(SUFFIXES, "OSError")
    check_old(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="timers are POSIX")
def test_an_interrupted_export_leaves_a_whole_file(tmp_path):
    said = run(tmp_path, "signal.signal(signal.SIGALRM, signal.default_int_handler)\n" + INTERRUPTED)
    assert "broken" not in said.values()
    assert "interrupted" in said.values()
    check_old(tmp_path)


def test_an_interruption_between_any_two_lines_leaves_nothing_beside(tmp_path):
    path, line, finished = tmp_path / "old.json", 0, False
    path.write_text("old")

    def interrupt(frame, event, arg):
        nonlocal seen
        if frame.f_code.co_filename != _files.__file__:
            return None
        seen += event == "line"
        if event == "line" and seen == line:
            raise KeyboardInterrupt
        return interrupt

    while not finished:
        line, seen = line + 1, 0
        sys.settrace(interrupt)
        try:
            _files.write_text(path, "new")
            finished = True
        except KeyboardInterrupt:
            pass
        finally:
            sys.settrace(None)
        assert [p.name for p in tmp_path.iterdir()] == ["old.json"]
        assert path.read_text() in ("old", "new")
    assert line > 8
