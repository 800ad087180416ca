"""What tests of `diff3ds views` share: runs that are broken off and resumed, and how far sketches lie apart."""

import functools
import json
import os
import signal
import subprocess
import sys
import time

import torch
from safetensors import safe_open

import diff3ds as ds
from diff3ds.cli import STOPPED, main

RESULTS = ["preview.png", "progress.json", "run.json", "sketch.json", "sketch.step", "sketch.svg", "targets.png"]
FILES, EDGE_FILES = ["checkpoint.safetensors", *RESULTS], ["edges.safetensors", *RESULTS]


def distances(a: ds.Sketch, b: ds.Sketch):
    """From points along the strokes of one sketch to the nearest stroke of the other."""
    points = ds.bezier.evaluate(a.points, a.weights, torch.linspace(0, 1, 21)).reshape(1, -1, 3)
    return ds.bezier.closest_point(b.points, b.weights, points.expand(len(b.points), -1, 3)).distance.amin(0)


def interrupted(options, out, checkpoint):
    """The exit code and messages of a run that gets Ctrl-C once its checkpoint is there."""
    command = [sys.executable, "-m", "diff3ds.cli", "views", *options, "-o", str(out)]
    # Shells start background jobs with Ctrl-C ignored, and the tests may run in one.
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    environment = {**os.environ, "TERM": "dumb"}
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment, preexec_fn=heed)
    while not has_something(out / checkpoint) and run.poll() is None:
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    _, messages = run.communicate(timeout=300)
    return run.returncode, messages


def has_something(checkpoint):
    """Whether there is a checkpoint, and for edges one with the first curves."""
    if not checkpoint.exists() or checkpoint.name != "edges.safetensors":
        return checkpoint.exists()
    with safe_open(checkpoint, "pt") as file:
        return json.loads(file.metadata()["diff3ds edges"])["stage"] > 0


def assert_resumed_ends_as_unbroken(folder, options, files):
    code, messages = interrupted(options, folder / "broken", files[0])
    assert code == STOPPED, messages
    # A run that ends before its first strokes has told nothing of them.
    names = {p.name for p in (folder / "broken").iterdir()}
    assert {*files} - {"progress.json", "targets.png"} <= names <= {*files}
    assert json.loads((folder / "broken" / "run.json").read_text())["stopped_early"]
    main(["views", *options, "-o", str(folder / "broken"), "--resume"])
    main(["views", *options, "-o", str(folder / "whole")])
    for name in ("sketch.json", "sketch.step"):
        assert (folder / "broken" / name).read_bytes() == (folder / "whole" / name).read_bytes()
    runs = [json.loads((folder / name / "run.json").read_text()) for name in ("broken", "whole")]
    assert runs[0]["steps_done"] == runs[1]["steps_done"] > 0
    assert runs[0]["loss"] == runs[1]["loss"]
