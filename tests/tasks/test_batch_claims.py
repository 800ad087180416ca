"""Claims: a job is one's own alone, and free again when whoever had it is dead."""

import json
import multiprocessing
import os
import subprocess
import sys
import threading

import pytest

from diff3ds.tasks.batch import claims as module
from diff3ds.tasks.batch.claims import Claims, Outcome


@pytest.fixture
def claims(tmp_path):
    return Claims(tmp_path / "attempts")


def dead_process() -> int:
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    return done.pid


def foreign(claims, job, **record):
    """A claim of another machine."""
    claim = claims.claim(job)
    claim.record.update({"machine": "another", "driver": 1, "process": 2, **record})
    claim._write()
    return claim


def test_of_many_that_want_a_job_one_has_it(claims):
    found = []
    barrier = threading.Barrier(16)

    def want():
        barrier.wait()
        found.append(claims.claim("a/job"))

    threads = [threading.Thread(target=want) for _ in range(16)]
    [t.start() for t in threads]
    [t.join() for t in threads]
    # Threads that looked after the first had made its file see it and make the next: each number is made once.
    numbers = [c.number for c in found if c]
    assert len(numbers) == len(set(numbers)) >= 1
    assert sorted(os.listdir(claims.folder / "a/job")) == sorted(f"{n}.json" for n in numbers)


def test_without_links_it_is_the_same(claims, monkeypatch):
    def none(*_):
        raise PermissionError("no links here")

    monkeypatch.setattr(os, "link", none)
    first = claims.claim("job")
    monkeypatch.setattr(claims, "tries", lambda job: 0)
    assert first is not None
    assert claims.claim("job") is None
    assert json.loads(first.path.read_text())["driver"] == os.getpid()


def test_a_claim_of_this_machine_is_free_when_its_processes_are_gone(claims):
    claim = claims.claim("job")
    assert claims.is_busy("job")
    claim.record["driver"] = dead_process()
    claim._write()
    assert not claims.is_busy("job")
    # The job goes on although the batch that began it is gone.
    claim.began(os.getpid())
    assert claims.is_busy("job")
    claim.began(dead_process())
    assert not claims.is_busy("job")
    assert claims.claim("job").number == 2
    assert claim.is_lost


def test_a_claim_of_another_machine_is_free_when_its_heart_stops(claims, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    claim = foreign(claims, "job")
    # Its clock may be years off.
    os.utime(claim.path, (1, 1))
    assert claims.is_busy("job")
    now[0] = module.LEASE - 1
    os.utime(claim.path, (2, 2))
    assert claims.is_busy("job")
    now[0] += module.LEASE - 1
    assert claims.is_busy("job")
    now[0] += 2
    assert not claims.is_busy("job")


def test_what_became_of_a_try_is_known_to_all(claims):
    claim = foreign(claims, "job")
    assert claims.outcome("job", 1) is None
    claim.end(Outcome("failed", "no memory", seconds=2.5))
    assert claims.outcome("job", 1) == Outcome("failed", "no memory", seconds=2.5)
    assert not claims.is_busy("job")
    assert claims.tries("job") == 1
    assert claims.tries("other") == 0


def test_a_file_that_is_half_written_is_a_claim_of_somebody(claims):
    (claims.folder / "job").mkdir(parents=True)
    (claims.folder / "job" / "1.json").write_text("")
    assert claims.is_busy("job")


def test_machines_are_told_apart():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(module.machine) == module.machine() != ""
