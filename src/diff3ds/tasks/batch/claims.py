"""Who does which job: every try has a numbered file, which whoever makes it first owns, on this machine or another.

ATTEMPTS/JOB/3.json is the third try of a job: its claim while it runs, told apart from a dead one by its heart-beat
(the file's time, compared with itself only, since clocks of machines differ), and what became of it afterwards. A job
whose last try has no outcome and no heart-beat is free: the next try is the file with the next number, which only one
can make. No other lock is needed, nor a scheduler.
"""

import functools
import json
import os
import platform
import secrets
import time
import uuid
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from diff3ds._files import write_text

# Seconds between heart-beats, and without one until a claim of another machine is taken for dead. Network disks may
# show the times of files up to a minute late (NFS's acregmax).
BEAT, LEASE = 15.0, 180.0
# Letters of a message that a table and a terminal show.
LONG = 200


@dataclass(frozen=True)
class Outcome:
    """What became of a try.

    Attributes:
        state: done, failed, killed, timeout, or stopped (by whoever ran the batch).
        message: why.
        final: whether another try would end the same: the input is at fault.
        seconds: that it took.
    """

    state: str
    message: str = ""
    final: bool = False
    seconds: float = 0.0


def shortened(message: str) -> str:
    """A message as one line that fits a table; the whole of it is in the log of its try."""
    line = " ".join(message.split())
    return line if len(line) <= LONG else f"{line[: LONG - 1]}…"


@dataclass
class Claim:
    """A try that is this process's own."""

    path: Path
    number: int
    record: dict[str, Any]

    def began(self, process: int) -> None:
        """Says which process does the job."""
        self.record["process"] = process
        self._write()

    def beat(self) -> None:
        """Says that it goes on."""
        with suppress(FileNotFoundError):
            os.utime(self.path)

    @property
    def is_lost(self) -> bool:
        """Whether another took this one for dead, such as after a sleep of this machine."""
        return self.path.with_name(f"{self.number + 1}.json").exists() or not self.path.exists()

    def end(self, outcome: Outcome) -> None:
        """Says what became of it."""
        self.record["outcome"] = asdict(outcome)
        self._write()

    def drop(self) -> None:
        """Takes it back: there was nothing to do."""
        self.path.unlink(missing_ok=True)

    def _write(self) -> None:
        write_text(self.path, json.dumps(self.record))


@dataclass
class Claims:
    """The tries of all jobs of a batch.

    Attributes:
        folder: ATTEMPTS.
    """

    folder: Path
    _seen: dict[str, tuple[int, int, float]] = field(default_factory=dict)

    def tries(self, job: str) -> int:
        """The number of the last try; 0 before the first."""
        try:
            names = os.listdir(self.folder / job)
        except FileNotFoundError:
            return 0
        return max((int(name[:-5]) for name in names if name.endswith(".json") and name[:-5].isdigit()), default=0)

    def outcome(self, job: str, number: int) -> Outcome | None:
        """What became of a try; None of one that goes on, or ended without a word."""
        found = self._record(job, number).get("outcome")
        return Outcome(**found) if found else None

    def is_busy(self, job: str) -> bool:
        """Whether somebody is at a job, as far as one can see."""
        number = self.tries(job)
        if number == 0:
            return False
        path, record = self._path(job, number), self._record(job, number)
        if record.get("outcome"):
            return False
        if record.get("machine") == machine() and not any(_lives(record.get(p)) for p in ("driver", "process")):
            return False
        try:
            beat = path.stat().st_mtime_ns
        except FileNotFoundError:
            return False
        now = time.monotonic()
        seen = self._seen.get(job)
        if seen is None or seen[:2] != (number, beat):
            self._seen[job] = (number, beat, now)
            return True
        return now - seen[2] < LEASE

    def claim(self, job: str) -> Claim | None:
        """The next try of a job, which must not be busy; None if another was faster."""
        number = self.tries(job) + 1
        path = self._path(job, number)
        path.parent.mkdir(parents=True, exist_ok=True)
        record = {"machine": machine(), "host": platform.node(), "driver": os.getpid(), "begun": time.time()}
        text = json.dumps(record)
        # Made elsewhere and linked, so that nobody sees it half written; where a disk has no links, made in its place.
        temporary = path.with_name(f".{secrets.token_hex(8)}")
        try:
            temporary.write_text(text, encoding="utf-8")
            made = _linked(temporary, path, text)
        finally:
            temporary.unlink(missing_ok=True)
        return Claim(path, number, record) if made else None

    def _path(self, job: str, number: int) -> Path:
        return self.folder / job / f"{number}.json"

    def _record(self, job: str, number: int) -> dict[str, Any]:
        """What the file of a try says; nothing while it is being made."""
        try:
            found = json.loads(self._path(job, number).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}


def _linked(temporary: Path, path: Path, text: str) -> bool:
    """Whether this process was the one that made the file."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        return False
    except OSError:
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            return False
    return True


@functools.cache
def machine() -> str:
    """Names the processes that this one can see: a machine since its start, and on Linux a container on it."""
    with suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{boot}/{os.stat('/proc/self/ns/pid').st_ino}"
    return f"{uuid.getnode():x}/{platform.node()}"


def _lives(process: Any) -> bool:
    """Whether there is a process of this number on this machine."""
    if not isinstance(process, int):
        return False
    if os.name == "nt":
        # A signal of 0 would end it there: the heart-beat alone decides.
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return not _is_over(process)


def _is_over(process: int) -> bool:
    """Whether it has ended, and only waits for its parent to notice."""
    try:
        stat = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] in ("Z", "X")
