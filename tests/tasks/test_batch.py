"""Batches: each job is done once, the same to the byte, whoever is killed on the way."""

import csv
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from waiting import PATIENCE, until

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.tasks.batch.batch import run_batch
from diff3ds.tasks.batch.batch_options import BatchOptions
from diff3ds.tasks.batch.claims import Claims
from diff3ds.tasks.batch.job_file import read_jobs

pytestmark = pytest.mark.skipif(os.name == "nt", reason="ends processes by signals")
SMALL = {"command": "text", "prior": "exemplar", "steps": 4, "strokes": 6, "size": 16, "sheet_every": 0}
# Long enough to be killed: checkpoints come every 100 steps.
LONG = {**SMALL, "steps": 300}
FILES = ("sketch.json", "sketch.svg", "sketch.step", "preview.png")


def jobs_in(folder: Path, *jobs: dict) -> Path:
    path = folder / "jobs.jsonl"
    path.write_text("\n".join(map(json.dumps, jobs)))
    return path


def table(out: Path) -> list[dict[str, str]]:
    with (out / "summary.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def files(out: Path, name: str) -> dict[str, bytes]:
    return {file: (out / name / file).read_bytes() for file in FILES}


def job_process(out: Path, name: str) -> int:
    """The process of the job's last try, once its first checkpoint is there."""
    claims = Claims(out / "attempts")
    until((out / name / "checkpoint.safetensors").exists, "a checkpoint")
    return json.loads((claims.folder / name / f"{claims.tries(name)}.json").read_text())["process"]


def command(path: Path, out: Path, *more: str) -> subprocess.Popen:
    words = [sys.executable, "-m", "diff3ds.cli", "batch", str(path), "-o", str(out), "--workers", "2", *more]
    return subprocess.Popen(words, start_new_session=True, stderr=subprocess.PIPE, text=True)


def is_over(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What the long job draws when nobody disturbs it."""
    out = tmp_path_factory.mktemp("alone")
    options = {name: value for name, value in LONG.items() if name != "command"}
    ds.text_to_sketch("a chair", out, **options)
    return {file: (out / file).read_bytes() for file in FILES}


def test_all_are_done_once_and_one_that_fails_stops_no_other(tmp_path):
    mesh = tmp_path / "broken.stl"
    mesh.write_text("no mesh")
    small = {**SMALL, "phrase": "a table", "method": "swift", "sweep": {"seed": [0, 1]}}
    path = jobs_in(tmp_path, {"command": "mesh", "source": "broken.stl"}, small)
    said = []
    states = run_batch(path, tmp_path / "out", BatchOptions(workers=2), say=said.append)
    assert [s.state for s in states] == ["failed", "done", "done"]
    # What is wrong with the input is not tried again.
    assert [s.tries for s in states] == [1, 1, 1]
    assert len(said) == 1
    assert "broken.stl" in said[0]
    rows = table(tmp_path / "out")
    assert [row["state"] for row in rows] == ["failed", "done", "done"]
    assert [row["seed"] for row in rows] == ["", "0", "1"]
    assert "broken.stl" in rows[0]["message"]
    text = (tmp_path / "out" / "summary.md").read_text()
    assert "2 of 3 jobs done, 1 failed." in text
    assert "| swift | 2 |" in text
    from PIL import Image

    with Image.open(tmp_path / "out" / "sheet.png") as sheet:
        assert sheet.size == (2 * 160, 174)
        assert min(sheet.convert("L").crop((0, 0, 160, 160)).tobytes()) < 128
    # By itself the command gives the same bytes.
    options = {name: value for name, value in SMALL.items() if name != "command"}
    ds.text_to_sketch("a table", tmp_path / "alone", seed=1, **options)
    assert files(tmp_path / "out", states[2].job.name) == files(tmp_path, "alone")
    # Once more: nothing is done twice, but what failed is tried again.
    before = {s.job.name: (tmp_path / "out" / s.job.name / "run.json").stat().st_mtime_ns for s in states[1:]}
    again = run_batch(path, tmp_path / "out", BatchOptions(workers=2))
    assert [s.tries for s in again] == [2, 1, 1]
    assert before == {s.job.name: (tmp_path / "out" / s.job.name / "run.json").stat().st_mtime_ns for s in again[1:]}


def test_shards_do_their_part_and_the_table_has_all(tmp_path):
    path = jobs_in(tmp_path, {**SMALL, "phrase": "a chair", "sweep": {"seed": [0, 1, 2]}})
    states = run_batch(path, tmp_path / "out", BatchOptions(shard="2/2"))
    assert [s.state for s in states] == ["waiting", "done", "waiting"]
    states = run_batch(path, tmp_path / "out", BatchOptions(shard="1/2"))
    assert [(s.state, s.tries) for s in states] == [("done", 1)] * 3


@pytest.mark.slow
def test_a_killed_job_goes_on_from_its_checkpoint(tmp_path, alone):
    path = jobs_in(tmp_path, {**LONG, "phrase": "a chair"})
    out = tmp_path / "out"
    (job,) = read_jobs(path)
    found, said = [], []
    batch = threading.Thread(target=lambda: found.extend(run_batch(path, out, BatchOptions(), say=said.append)))
    batch.start()
    os.kill(job_process(out, job.name), signal.SIGKILL)
    batch.join()
    assert [(s.state, s.tries) for s in found] == [("done", 2)]
    assert "killed: signal 9" in said[0]
    assert files(out, job.name) == alone


def test_no_more_tries_than_asked_for(tmp_path):
    path = jobs_in(tmp_path, {**LONG, "phrase": "a chair"})
    out = tmp_path / "out"
    (job,) = read_jobs(path)
    found = []
    batch = threading.Thread(target=lambda: found.extend(run_batch(path, out, BatchOptions(retries=0))))
    batch.start()
    os.kill(job_process(out, job.name), signal.SIGKILL)
    batch.join()
    assert [(s.state, s.tries) for s in found] == [("killed", 1)]


def test_time_limits_stop_a_try_and_keep_what_it_reached(tmp_path):
    path = jobs_in(tmp_path, {**LONG, "steps": 1_000_000, "phrase": "a chair"})
    (state,) = run_batch(path, tmp_path / "out", BatchOptions(timeout=2.0, retries=0))
    assert state.state == "timeout"
    assert (tmp_path / "out" / state.job.name / "checkpoint.safetensors").exists()
    assert json.loads((tmp_path / "out" / state.job.name / "run.json").read_text())["stopped_early"]


@pytest.mark.parametrize(
    "whom", ["interrupted", *(pytest.param(w, marks=pytest.mark.slow) for w in ("driver", "group", "terminated"))]
)
def test_a_batch_that_is_ended_goes_on(whom, tmp_path, alone):
    """Its jobs end with it, and another call is at once free to take them up."""
    path = jobs_in(tmp_path, {**LONG, "phrase": "a chair"}, {**SMALL, "phrase": "a table"})
    out = tmp_path / "out"
    job, other = read_jobs(path)
    batch = command(path, out)
    process = job_process(out, job.name)
    number = {"interrupted": signal.SIGINT, "terminated": signal.SIGTERM}.get(whom, signal.SIGKILL)
    (os.killpg if whom == "group" else os.kill)(batch.pid, number)
    _, said = batch.communicate(timeout=PATIENCE)
    if whom in ("interrupted", "terminated"):
        assert batch.returncode == 130
        assert "the same command goes on" in said
        assert is_over(process)
        assert "1 stopped" in (out / "summary.md").read_text()
    until(lambda: is_over(process), "the end of the job")
    states = run_batch(path, out, BatchOptions(workers=2))
    assert [s.state for s in states] == ["done", "done"]
    assert states[0].tries == 2
    assert files(out, job.name) == alone
    assert states[1].job == other


@pytest.mark.slow
def test_two_batches_share_a_folder(tmp_path):
    path = jobs_in(tmp_path, {**SMALL, "phrase": "a chair", "sweep": {"seed": list(range(6))}})
    out = tmp_path / "out"
    batches = [command(path, out) for _ in range(2)]
    for batch in batches:
        batch.communicate(timeout=PATIENCE)
        assert batch.returncode == 0
    rows = table(out)
    assert [(row["state"], row["tries"]) for row in rows] == [("done", "1")] * 6


def test_a_full_disk_fails_the_job_and_another_call_does_it(tmp_path, monkeypatch):
    """Results that cannot be written leave no run.json, so that the job is not taken for done."""
    path = jobs_in(tmp_path, {**SMALL, "phrase": "a chair"})
    out = tmp_path / "out"
    (job,) = read_jobs(path)
    # A folder stands where the preview is to be written.
    (out / job.name / "preview.png").mkdir(parents=True)
    (state,) = run_batch(path, out, BatchOptions())
    assert state.state == "failed"
    (out / job.name / "preview.png").rmdir()
    (state,) = run_batch(path, out, BatchOptions())
    assert state.state == "done"


@pytest.mark.slow
def test_the_command_says_how_it_went(tmp_path, capsys):
    path = jobs_in(tmp_path, {**SMALL, "phrase": "a chair"})
    batch = command(path, tmp_path / "out", "--gpus", "none")
    _, said = batch.communicate(timeout=PATIENCE)
    assert batch.returncode == 0
    assert "1 of 1 jobs done" in said
    path = jobs_in(tmp_path, {**SMALL, "phrase": "a chair", "stepz": 1})
    with pytest.raises(SystemExit) as ended:
        main(["batch", str(path), "-o", str(tmp_path / "other")])
    assert ended.value.code == FAULT
    assert "line 1: text has no option 'stepz'" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()
