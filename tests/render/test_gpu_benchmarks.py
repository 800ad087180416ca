"""What benchmarks/render_cuda.py and profile_cuda.py do beside measuring, without a GPU."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

import diff3ds as ds

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import profile_cuda
import render_cuda

WORKLOAD = render_cuda.GPU_WORKLOADS["A"]
FORWARD, BACKWARD, BOTH = render_cuda.must_move(WORKLOAD).values()


def test_what_must_move_is_what_the_tensors_take():
    """Of a drawing: images out and strokes in; the gradient of colour and strokes in, their gradients out."""
    sketch, cameras = render_cuda.scene(workload := WORKLOAD._replace(size=(24, 32)))
    image = ds.render(sketch, cameras)
    strokes = sum(getattr(sketch, name).nbytes for name in ("points", "weights", "width", "color", "opacity"))
    forward = strokes + image.color.nbytes + image.alpha.nbytes + image.depth.nbytes
    backward = image.color.nbytes + 2 * strokes
    found = render_cuda.must_move(workload)
    assert found == {"forward": forward, "backward": backward, "both": forward + backward}


def test_bytes_and_speed_of_a_copy_are_told(monkeypatch, capsys, tmp_path):
    """Beside the times, on the terminal and in the file."""
    times = {f"{way}, {clock}": 0.125 for way in ("forward", "backward", "both") for clock in ("device", "user")}
    times["both, one thread"] = 0.125
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "a GPU")
    monkeypatch.setattr(render_cuda, "copy_speed", lambda: 4e9)
    monkeypatch.setattr(render_cuda, "first_calls", lambda: {"first call, s": 1.0, "later process, s": 0.05})
    monkeypatch.setattr(render_cuda, "measure", lambda workload: {"memory, MB": 3.0, **times})
    render_cuda.main("A", True, tmp_path / "figures.json")
    figures = json.loads((tmp_path / "figures.json").read_text())["figures"]
    found = figures["workloads"]["A"]
    assert figures["copy, TB/s"] == 4.0
    assert [found[f"{way}, bytes"] for way in ("forward", "backward", "both")] == [FORWARD, BACKWARD, BOTH]
    assert found["both, floor"] == pytest.approx(BOTH / 4e9)
    printed = capsys.readouterr().out
    assert f"{FORWARD / 1e6:.4g}" in printed
    assert f"{BACKWARD / 1e6:.4g}" in printed


def test_the_profiler_sees_one_warm_pass(monkeypatch):
    events = []
    for where, name in ((torch.cuda, "synchronize"), (torch.cuda.profiler, "start"), (torch.cuda.profiler, "stop")):
        monkeypatch.setattr(where, name, lambda name=name: events.append(name))
    profile_cuda.profile(SimpleNamespace(both=lambda: events.append("both")))
    warm, seen = ["both"] * render_cuda.WARM_UP, ["start", "both", "synchronize", "stop"]
    assert events == [*warm, "synchronize", *seen]
