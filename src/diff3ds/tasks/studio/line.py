"""The line of the studio's jobs: one is made at a time, in a process of its own, and none is lost with the studio."""

import json
import os
import shutil
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from diff3ds.tasks.batch.commands import MODULES, SUBJECTS, check_options
from diff3ds.tasks.batch.finished import is_finished
from diff3ds.tasks.batch.job_process import GRACE, Work, interrupt, kill, process_context, run_job
from diff3ds.tasks.studio.entry import Entry, entries_in, free_name

LOG = "studio.log"
# What was deleted, until it is deleted for good, by hand.
BIN = ".deleted"
# Things that may wait at a time: more are a mistake, or somebody else's.
MOST_WAITING = 200
LOOK = 0.2


class Line:
    """What there is and what is to be made, in the order in which it was asked for."""

    def __init__(self, out: Path, say: Callable[[str], None]) -> None:
        """Reads what there is; what was being made when the studio ended waits again.

        Args:
            out: the folder of the studio.
            say: told what failed.
        """
        self.out, self._say = out, say
        self._changed = threading.Condition()
        self._entries = {entry.name: entry for entry in entries_in(out)}
        for entry in self._entries.values():
            if entry.state == "running":
                entry.state = "waiting"
        self._stopping: set[str] = set()
        self._ended = False
        self._thread = threading.Thread(target=self._work, daemon=True)

    def __enter__(self) -> "Line":
        """Begins to work."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ends; what is being made keeps what it has reached, and goes on with the next studio of this folder."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._thread.join()

    def entries(self) -> list[Entry]:
        """All, the latest first."""
        with self._changed:
            return sorted(self._entries.values(), key=lambda entry: -entry.made)

    def entry(self, name: str) -> Entry | None:
        """The one of this name."""
        with self._changed:
            return self._entries.get(name)

    def took_before(self, entry: Entry) -> dict[str, float]:
        """The seconds of the stages of what the same command made last with the same options, of any subject."""

        def how(one: Entry) -> object:
            left_out = (SUBJECTS.get(one.command), "shows")
            return one.command, {name: value for name, value in one.options.items() if name not in left_out}

        alike = (one for one in self.entries() if one.took and one.state == "done" and how(one) == how(entry))
        return next((one.took for one in alike), {})

    def add(self, title: str, command: str, options: dict[str, Any]) -> Entry:
        """Puts something to be made at the end of the line.

        Raises:
            ValueError, TypeError, FileNotFoundError: the command does not take these options; too much waits.
            OSError: the folder cannot be written.
        """
        check_options(command, options, self.out)
        with self._changed:
            if sum(entry.state == "waiting" for entry in self._entries.values()) >= MOST_WAITING:
                raise ValueError(f"{MOST_WAITING} things wait already: let some of them be made, or stop them")
            return self._put(title, command, options, "waiting")

    def put(self, title: str, fill: Callable[[Path], None]) -> Entry:
        """Adds what needs no making: `fill` writes its sketch into a folder.

        Raises:
            ValueError, OSError: as `fill`.
        """
        with self._changed:
            entry = self._put(title, "", {}, "done")
        try:
            fill(self.out / entry.name)
        except BaseException:
            with self._changed:
                del self._entries[entry.name]
            shutil.rmtree(self.out / entry.name)
            raise
        return entry

    def _put(self, title: str, command: str, options: dict[str, Any], state: Any) -> Entry:
        name = free_name(self.out, title)
        entry = Entry(name, title, command, options, time.time(), state)
        (self.out / name).mkdir(parents=True)
        entry.keep(self.out)
        self._entries[name] = entry
        self._changed.notify_all()
        return entry

    def stop(self, name: str) -> None:
        """Stops what is made or waits; what it has reached is kept.

        Raises:
            ValueError: it is neither made nor waits.
        """
        with self._changed:
            entry = self._known(name)
            if entry.state not in ("waiting", "running"):
                raise ValueError(f"{entry.title} is not being made: there is nothing to stop")
            if entry.state == "waiting":
                self._settle(entry, "stopped")
            else:
                self._stopping.add(name)

    def resume(self, name: str) -> None:
        """Puts what was stopped or failed back into the line, where it goes on from what it has reached.

        Raises:
            ValueError: it is done, or in the line already.
        """
        with self._changed:
            entry = self._known(name)
            if entry.state not in ("stopped", "failed"):
                raise ValueError(f"{entry.title} is {entry.state}: there is nothing to go on with")
            entry.lines = []
            self._settle(entry, "waiting")

    def delete(self, name: str) -> None:
        """Takes something out of the studio: its folder goes to the folder `.deleted` beside it.

        Raises:
            ValueError: it is being made.
            OSError: it cannot be moved.
        """
        with self._changed:
            entry = self._known(name)
            if entry.state == "running":
                raise ValueError(f"{entry.title} is being made: stop it first")
            target = self.out / BIN
            target.mkdir(exist_ok=True)
            (self.out / name).rename(target / free_name(target, f"{name}-{int(time.time())}"))
            del self._entries[name]

    def duplicate(self, name: str) -> Entry:
        """A copy of what is made, to be edited.

        Raises:
            ValueError: it has no sketch yet.
            OSError: it cannot be copied.
        """
        with self._changed:
            entry = self._known(name)
            if entry.state in ("waiting", "running") or not (self.out / name / "sketch.json").is_file():
                raise ValueError(f"{entry.title} has no sketch yet: wait until it is made")
            copy = self._put(f"{entry.title} (copy)", entry.command, entry.options, entry.state)
            shutil.copytree(
                self.out / name, self.out / copy.name, dirs_exist_ok=True,
                ignore=shutil.ignore_patterns("studio.*", "*.autosave-*"),
            )  # fmt: skip
            return copy

    def again(self, name: str) -> Entry:
        """Makes something anew from its own sketch, of which strokes that are fixed stay.

        Raises:
            ValueError: it has no sketch, or none of a phrase, a picture or photographs.
        """
        entry = self._known(name)
        if entry.command not in ("text", "image", "views"):
            raise ValueError(f"{entry.title} was not drawn stroke by stroke: there is nothing to draw anew")
        if not (self.out / name / "sketch.json").is_file():
            raise ValueError(f"{entry.title} has no sketch yet: wait until it is made")
        return self.add(f"{entry.title} (again)", entry.command, {**entry.options, "start": f"{name}/sketch.json"})

    def _known(self, name: str) -> Entry:
        with self._changed:
            if name not in self._entries:
                raise ValueError(f"there is nothing called {name!r} here any more")
            return self._entries[name]

    def _settle(self, entry: Entry, state: Any, message: str = "") -> None:
        """Gives an entry a state, and keeps it."""
        with self._changed:
            entry.state, entry.message = state, message
            with suppress(OSError):
                entry.keep(self.out)
            self._changed.notify_all()

    # What the thread does

    def _work(self) -> None:
        # Whatever a job needs is loaded once, while the page is opened.
        context = process_context({*MODULES}, os.cpu_count() or 1)
        while True:
            with self._changed:
                waiting = None
                while not self._ended and waiting is None:
                    ready = [entry for entry in self._entries.values() if entry.state == "waiting"]
                    waiting = min(ready, key=lambda entry: entry.made, default=None)
                    if waiting is None:
                        self._changed.wait()
                if self._ended or waiting is None:
                    return
                self._settle(waiting, "running")
            self._make(waiting, context)

    def _make(self, entry: Entry, context: Any) -> None:
        """Makes one thing; however it ends, its state says so."""
        ours, theirs = context.Pipe()
        folder = self.out / entry.name
        work = Work(entry.command, entry.options, self.out, folder, folder / LOG, os.cpu_count() or 1, None, shown=True)
        process = context.Process(target=run_job, args=(work, theirs))
        entry.begin()
        try:
            process.start()
            theirs.close()
            with suppress(OSError):
                ours.send_bytes(b"begin")
            told = self._followed(entry, process, ours)
        finally:
            kill(process)
            process.join()
            ours.close()
        with self._changed:
            self._stopping.discard(entry.name)
            if is_finished(folder):
                entry.enter("")
                self._settle(entry, "done")
            elif self._ended:
                self._settle(entry, "waiting")
            elif told.get("state") == "stopped":
                self._settle(entry, "stopped")
            else:
                message = told.get("message") or "its process ended: is there enough memory?"
                self._settle(entry, "failed", message)
                self._say(f"{entry.name}: {message}")

    def _followed(self, entry: Entry, process: BaseProcess, channel: Connection) -> dict[str, Any]:
        """What a job tells at its end; it is told to stop where that is wanted, and killed if it does not."""
        killed_at = None
        while True:
            try:
                told = json.loads(channel.recv_bytes()) if channel.poll(LOOK) else None
            except (EOFError, OSError):
                return {"state": "stopped"} if killed_at else {}
            if told is not None:
                if "state" in told:
                    return dict(told)
                with self._changed:
                    entry.tell(told)
            elif not process.is_alive():
                return {"state": "stopped"} if killed_at else {}
            now = time.monotonic()
            if killed_at is None and (self._ended or entry.name in self._stopping):
                killed_at = now + GRACE
                interrupt(process)
            elif killed_at is not None and now > killed_at:
                kill(process)
                return {"state": "stopped"}
