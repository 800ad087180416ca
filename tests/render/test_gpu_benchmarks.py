"""What benchmarks/render_cuda.py and profile_cuda.py do beside measuring, without a GPU."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import profile_cuda
import render_cuda

# Colour, alpha and depth are 5 numbers of 4 bytes a pixel, the gradient of colour 3; a stroke has 21 numbers.
PIXELS, STROKES = 4 * 512 * 512, 56 * 21 * 4
FORWARD, BACKWARD = 20 * PIXELS + STROKES, 12 * PIXELS + 2 * STROKES


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
    assert [found[f"{way}, bytes"] for way in ("forward", "backward", "both")] == [
        FORWARD,
        BACKWARD,
        FORWARD + BACKWARD,
    ]
    assert found["both, floor"] == pytest.approx((FORWARD + BACKWARD) / 4e9)
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
