"""What `diff3ds batch` loses when it is killed again and again, and what it gains over jobs done one by one.

    python benchmarks/batch_kills.py OUT [--jobs 24] [--steps 300] [--kills 10] [--workers 2] [--seed 0] [--alone 24]
        [--ray]

The same small jobs are done three times: one command after the other (--alone: only so many of them), as one batch, and
as a batch to which at random times one of four things happens: a worker is killed, the driver is, the whole group of
processes is (all by SIGKILL), or the disk is full for a while. Whenever the batch has ended and jobs are left, the same
command is begun again. At the end every job must be done once, with the bytes of the first time, and the table must say
so. The batch that is killed lies on a disk in memory that only this script sees (Linux: unshare, mount), which it fills
to the last byte; --kills 0 leaves it out. With --ray a Ray of this machine does the jobs too, with as many workers.

Prints Markdown, and exits with 1 if anything was lost. On a loaded machine believe the processor's seconds.
"""

import argparse
import csv
import errno
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from report import environment

FILES = ("sketch.json", "sketch.svg", "sketch.step", "preview.png")
PHRASES = ("a chair", "a mug", "a table", "a lamp", "a house", "a bicycle")
EVENTS = ("worker", "driver", "group", "disk full")
# Seconds: in which an event comes after jobs are seen to run, and for which a full disk stays full.
WAIT, FULL = (0.2, 5.0), (2.0, 8.0)
# Of the disk in memory: jobs with their checkpoints take some 200 kB each.
DISK = "256m"
RAY = ("--runner", "ray")
COMMAND = (sys.executable, "-m", "diff3ds.cli")


@dataclass
class Event:
    """Something that happened to a batch.

    Attributes:
        what: one of EVENTS.
        seconds: since the batch was first begun.
        done: jobs that were done by then.
        ended: whether the batch ended by it, and was begun again.
    """

    what: str
    seconds: float
    done: int
    ended: bool = False


def main() -> None:
    """Does it all, and prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    for name, value in (("jobs", 24), ("steps", 300), ("kills", 10), ("workers", 2), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--alone", type=int)
    parser.add_argument("--ray", action="store_true")
    options = parser.parse_args()
    _with_a_disk_of_its_own(options.out)
    jobs = [_job(number, options.steps) for number in range(options.jobs)]
    file = options.out / "jobs.jsonl"
    file.write_text("\n".join(map(json.dumps, jobs)))
    some = jobs[: options.alone]
    times = [("one by one", len(some), *_one_by_one(some, options.out / "alone"))]
    times.append(("batch", len(jobs), *_together(file, options.out / "together", options.workers)))
    faults = _differences(options.out / "alone", options.out / "together", some)
    if options.ray:
        times.append(("Ray", len(jobs), *_together(file, options.out / "ray", options.workers, RAY)))
        faults += _same(options.out / "together", options.out / "ray")
    events: list[Event] = []
    if options.kills:
        events, lost = _killed(file, options.out / "disk" / "killed", options, options.out / "together")
        faults += lost
    print(f"{environment()['cpu']}; {options.jobs} jobs of {options.steps} steps, {options.workers} workers\n")
    print("| | jobs | s | processor's s a job | jobs a minute |\n|---|---|---|---|---|")
    for name, count, seconds, busy in times:
        print(f"| {name} | {count} | {seconds:.1f} | {busy / count:.1f} | {60 * count / seconds:.1f} |")
    if events:
        print("\n| | at s | done by then | the batch ended |\n|---|---|---|---|")
    for event in events:
        print(f"| {event.what} | {event.seconds:.1f} | {event.done} | {'yes' if event.ended else 'no'} |")
    print("\n" + ("\n".join(faults) or f"Nothing lost, nothing done twice: {options.jobs} jobs with the same bytes."))
    sys.exit(bool(faults))


def _with_a_disk_of_its_own(out: Path) -> None:
    """Goes on as the first process of name spaces whose OUT/disk is in memory; all goes when this process does."""
    disk = out / "disk"
    if os.environ.get("BATCH_KILLS_DISK") != str(disk):
        disk.mkdir(parents=True)
        os.environ["BATCH_KILLS_DISK"] = str(disk)
        inside = ["unshare", "--map-root-user", "--mount", "--pid", "--fork", "--mount-proc", sys.executable, *sys.argv]
        os.execvp(inside[0], inside)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", str(disk)], check=True)


def _job(number: int, steps: int) -> dict[str, object]:
    fixed = {"command": "text", "prior": "exemplar", "size": 32, "strokes": 16, "sheet_every": 0}
    return {**fixed, "phrase": PHRASES[number % len(PHRASES)], "seed": number, "steps": steps}


def _clock() -> tuple[float, float]:
    """Seconds, and those of the processor in all processes that have ended."""
    while True:
        try:
            # Also those whose parents went before them: they are the first process's.
            os.waitpid(-1, 0)
        except ChildProcessError:
            break
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.monotonic(), used.ru_utime + used.ru_stime


def _since(begun: tuple[float, float]) -> tuple[float, float]:
    now = _clock()
    return now[0] - begun[0], now[1] - begun[1]


def _one_by_one(jobs: list[dict[str, object]], out: Path) -> tuple[float, float]:
    """Each job by a command of its own, with all cores; gives the seconds."""
    begun = _clock()
    for job in jobs:
        words = [w for n, v in job.items() if n not in ("command", "phrase") for w in (f"--{n.replace('_', '-')}", v)]
        place = out / f"{job['seed']}"
        subprocess.run([*COMMAND, "text", job["phrase"], *map(str, words), "-o", place, "--quiet"], check=True)
    return _since(begun)


def _batch(file: Path, out: Path, workers: int, more: Sequence[str] = ()) -> subprocess.Popen:
    words = [*COMMAND, "batch", file, "-o", out, "--workers", str(workers), "--threads", "1", "--quiet", *more]
    # A group of its own, as a shell gives each command.
    with (out.parent / "said.txt").open("a") as said:
        return subprocess.Popen(words, start_new_session=True, stdout=said, stderr=said)


def _together(file: Path, out: Path, workers: int, more: Sequence[str] = ()) -> tuple[float, float]:
    begun = _clock()
    if code := _batch(file, out, workers, more).wait():
        raise SystemExit(f"the batch that nobody disturbed ended with code {code}")
    return _since(begun)


def _killed(file: Path, out: Path, options: argparse.Namespace, right: Path) -> tuple[list[Event], list[str]]:
    """A batch to which things happen until all is done; gives these, and what is wrong at the end."""
    chance, events, begun = random.Random(options.seed), [], time.monotonic()
    finished: dict[str, int] = {}
    kinds = [EVENTS[n % len(EVENTS)] for n in range(options.kills)]
    chance.shuffle(kinds)
    batch = _batch(file, out, options.workers)
    faults = []
    while kinds or batch.poll() is None:
        while batch.poll() is None and kinds and not _workers(out):
            time.sleep(0.1)
        end = time.monotonic() + chance.uniform(*WAIT)
        while batch.poll() is None and (time.monotonic() < end or (kinds[-1:] == ["worker"] and not _workers(out))):
            time.sleep(0.02)
        faults += _seen(out, finished)
        if batch.poll() is None and kinds:
            events.append(Event(kinds.pop(), time.monotonic() - begun, len(finished)))
            if not _happens(events[-1].what, batch, out, chance):
                # The worker has just ended by itself.
                kinds.append(events.pop().what)
        if batch.poll() is not None and (kinds or batch.returncode):
            if batch.returncode == 0:
                faults.append(f"all was done before {len(kinds)} things had happened: give --jobs or --steps more")
                break
            if events:
                events[-1].ended = True
            batch = _batch(file, out, options.workers)
    faults += [f"the batch ended with code {batch.returncode}"] if batch.wait() else []
    faults += _seen(out, finished) + _left(out) + _table(out, options.jobs)
    return events, faults + _same(right, out)


def _happens(what: str, batch: subprocess.Popen, out: Path, chance: random.Random) -> bool:
    """Whether it could happen."""
    if what == "worker":
        if not (workers := _workers(out)):
            return False
        os.kill(chance.choice(workers), signal.SIGKILL)
    elif what == "driver":
        batch.kill()
        batch.wait()
    elif what == "group":
        for process in (*_workers(out), batch.pid):
            os.killpg(os.getpgid(process), signal.SIGKILL)
        batch.wait()
    else:
        _fill(out.parent, chance.uniform(*FULL))
    return True


def _workers(out: Path) -> list[int]:
    """The processes of tries that run."""
    found = []
    for path in (out / "attempts").rglob("*.json"):
        record = json.loads(path.read_text() or "{}")
        process = record.get("process")
        if process and "outcome" not in record and _runs(process):
            found.append(process)
    return found


def _runs(process: int) -> bool:
    """Whether there is such a process, which has not ended and waits for its parent only."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _fill(disk: Path, seconds: float) -> None:
    """Leaves no byte free, for a while."""
    end, filler = time.monotonic() + seconds, disk / "filler"
    with filler.open("wb", buffering=0) as file:
        while time.monotonic() < end:
            try:
                file.write(bytes(4096))
            except OSError as error:
                if error.errno != errno.ENOSPC:
                    raise
                time.sleep(0.01)
    filler.unlink()


def _seen(out: Path, finished: dict[str, int]) -> list[str]:
    """Notes which jobs are done; says which were done again since the last look."""
    faults = []
    for path in out.glob("*/run.json"):
        if json.loads(path.read_text()).get("stopped_early") is False:
            written = path.stat().st_mtime_ns
            if finished.setdefault(path.parent.name, written) != written:
                faults.append(f"{path.parent.name} was done twice")
    return faults


def _left(out: Path) -> list[str]:
    """Processes that still run, and files that somebody began and never ended."""
    faults = [f"process {process} was left" for process in _workers(out)]
    expected = {path.name for path in (out.parent.parent / "together").rglob("*")}
    extra = sorted(
        str(p.relative_to(out)) for p in out.rglob("*") if p.name not in expected and "attempts" not in p.parts
    )
    return faults + [f"{path} was left" for path in extra]


def _table(out: Path, jobs: int) -> list[str]:
    with (out / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    tries = {row["job"]: len(list((out / "attempts" / row["job"]).glob("*.json"))) for row in rows}
    wrong = [row["job"] for row in rows if row["state"] != "done" or int(row["tries"]) != tries[row["job"]]]
    faults = [f"the table is wrong about {name}" for name in wrong]
    return faults + ([] if len(rows) == jobs else [f"the table has {len(rows)} rows for {jobs} jobs"])


def _same(right: Path, out: Path) -> list[str]:
    """Jobs of one batch whose files another one has not, to the byte."""
    jobs = [path.parent for path in right.glob("*/run.json")]
    return [
        f"{job.name}/{name} differs"
        for job in jobs
        for name in FILES
        if not (out / job.name / name).is_file() or (job / name).read_bytes() != (out / job.name / name).read_bytes()
    ]


def _differences(alone: Path, together: Path, jobs: list[dict[str, object]]) -> list[str]:
    """Jobs whose files the command by itself writes otherwise."""
    seeds = {json.loads((path / "run.json").read_text())["options"]["seed"]: path for path in together.glob("*-*")}
    return [
        f"{job['phrase']}, seed {job['seed']}: {name} differs from the command's by itself"
        for job in jobs
        for name in FILES
        if (alone / str(job["seed"]) / name).read_bytes() != (seeds[job["seed"]] / name).read_bytes()
    ]


if __name__ == "__main__":
    main()
