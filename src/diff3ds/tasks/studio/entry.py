"""A thing in the studio: what makes it, how far that is, and the file that keeps both in its folder."""

import json
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any, Literal

from diff3ds._files import read_json, write_text
from diff3ds.tasks.batch.commands import SUBJECTS

FILE, VERSION = "studio.json", 1
# A folder of the studio: letters that every system takes.
NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")
# Lines of what a job says that are shown.
MOST_LINES = 40

State = Literal["waiting", "running", "done", "stopped", "failed"]
KEPT = ("title", "command", "options", "made", "state", "message", "took")


@dataclass
class Entry:
    """One thing.

    Attributes:
        name: of its folder.
        title: for people.
        command: of diff3ds that makes it; "" for a sketch that came as a file.
        options: of the command, by their names, with its subject; paths are relative to the folder of the studio.
        made: when it was asked for, seconds of the clock.
        state: of its making.
        message: why it failed.
        stage, done, total: where its command is.
        began, since: when its making and when this stage began, seconds of a clock that runs evenly.
        took: seconds of each stage that is over, in their order.
        lines: what its command said.
    """

    name: str
    title: str
    command: str
    options: dict[str, Any]
    made: float
    state: State = "waiting"
    message: str = ""
    stage: str = ""
    done: int = 0
    total: int | None = None
    began: float = 0.0
    since: float = 0.0
    took: dict[str, float] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    def keep(self, out: Path) -> None:
        """Writes what must not be lost.

        Raises:
            OSError: it cannot be written.
        """
        kept = {"version": VERSION, **{name: getattr(self, name) for name in KEPT}}
        write_text(out / self.name / FILE, json.dumps(kept, indent=1) + "\n")

    def tell(self, told: Mapping[str, Any]) -> None:
        """Takes what its job tells."""
        if "line" in told:
            self.lines = [*self.lines, str(told["line"])][-MOST_LINES:]
            return
        if told["stage"] != self.stage:
            self.enter(told["stage"])
        self.done, self.total = told["done"], told["total"]

    def begin(self) -> None:
        """Its making begins."""
        self.began = self.since = monotonic()
        self.stage, self.done, self.total, self.took = "starting", 0, None, {}

    def enter(self, stage: str) -> None:
        """The stage before is over."""
        now = monotonic()
        self.took[self.stage] = self.took.get(self.stage, 0.0) + now - self.since
        self.stage, self.since = stage, now

    def times(self, before: Mapping[str, float]) -> dict[str, float | None]:
        """Seconds that its making has `spent`, and that are left of this `stage` and of `all`; None where nobody knows.

        Of the stage so much is known once a tenth of it is done; of those ahead what they took before, by the pace of
        what is behind.

        Args:
            before: the seconds of the stages of something that was made alike; none if there is nothing.
        """
        if self.state != "running":
            return {"spent": None, "stage": None, "all": None}
        now = monotonic()
        spent = now - self.since
        known = self.total is not None and self.done >= max(self.total / 10, 1)
        whole = spent * (self.total or 0) / self.done if known else None
        left = None
        if self.stage in before:
            here = max(before[self.stage], spent) if whole is None else whole
            behind = sum(before.get(stage, 0.0) for stage in self.took) + before[self.stage]
            pace = (sum(self.took.values()) + here) / max(behind, 1e-3)
            ahead = sum(took for stage, took in before.items() if stage not in self.took and stage != self.stage)
            left = here - spent + pace * ahead
        return {"spent": now - self.began, "stage": None if whole is None else whole - spent, "all": left}

    def line(self, out: Path) -> str:
        """What does the same in a terminal."""
        if not self.command:
            return ""
        words = ["diff3ds", self.command]
        for name, value in self.options.items():
            if name == SUBJECTS[self.command]:
                words.insert(2, str(out / value) if name != "phrase" else str(value))
            elif isinstance(value, bool):
                words.append(f"--{'' if value else 'no-'}{name.replace('_', '-')}")
            else:
                option = "from" if name == "start" else name.replace("_", "-")
                words += [f"--{option}", str(out / value) if name == "start" else str(value)]
        return shlex.join([*words, "-o", str(out / self.name)])


def entries_in(out: Path) -> list[Entry]:
    """The things in a studio's folder, the oldest first; what is none of them is left alone."""
    found = []
    for path in out.glob(f"*/{FILE}") if out.is_dir() else []:
        try:
            content = read_json(path)
            if NAME.fullmatch(path.parent.name) and content["version"] == VERSION:
                found.append(Entry(path.parent.name, **{name: content[name] for name in KEPT if name in content}))
        except (OSError, ValueError, KeyError, TypeError):
            continue
    return sorted(found, key=lambda entry: entry.made)


def free_name(out: Path, title: str) -> str:
    """A name for a folder that is none yet, from a title."""
    words = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:40].strip("-") or "sketch"
    names = [words, *(f"{words}-{number}" for number in range(2, 10_000))]
    return next(name for name in names if not (out / name).exists())
