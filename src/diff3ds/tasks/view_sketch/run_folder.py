"""What the folder of a run has to show beside its sketch: how far it is, its losses, its log and its pictures."""

import math
import time
from pathlib import Path
from typing import Any

from diff3ds._files import read_json
from diff3ds.tasks.run_log import PROGRESS, read_log

# The pictures that runs write, by their names, in the order in which they are shown: all of a name, or the latest.
PICTURES = (
    ("targets.png", "Made from", False),
    ("reference.png", "Made from", False),
    ("lines.png", "Its lines", False),
    ("progress/step_*.png", "On the way", True),
    ("preview.png", "Preview", False),
    ("drawing-*.png", "Drawing", False),
)
# So many bytes are no picture of a run.
MOST_BYTES = 1 << 25


def told_by(folder: Path) -> dict[str, Any]:
    """What a page shows of a run: `stage`, `done`, `total`, `note`, `losses`, `log`; `ended`, how, or None; `silent`,
    seconds since it told something; `pictures`, each with its `name`, `label` and `version`.

    Of a run that told nothing, what its results say. What cannot be read is left out: it may be in the making.
    """
    told: dict[str, Any] = {"stage": "", "done": 0, "total": None, "note": "", "ended": None, "silent": 0.0}
    told |= {"losses": {"every": 1, "values": []}, "log": []}
    try:
        log = read_log(folder)
        if log is not None:
            told |= {name: log[name] for name in told.keys() & log.keys()}
            told |= {"losses": _curve(log["losses"]), "log": [str(line) for line in log["log"]]}
            told["silent"] = max(0.0, time.time() - (folder / PROGRESS).stat().st_mtime)
        elif (folder / "run.json").is_file():
            told |= _result(read_json(folder / "run.json"))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        told["log"] = [f"warning: {error}"]
    return {**told, "pictures": pictures_of(folder)}


def _result(run: dict[str, Any]) -> dict[str, Any]:
    scores = [f"{name} {value:.4g}" for name, value in run.get("scores", {}).items()]
    return {"ended": "stopped" if run["stopped_early"] else "done", "losses": _curve(run["loss"]), "log": scores}


def _curve(losses: dict[str, Any]) -> dict[str, Any]:
    """Losses as JSON for browsers has them: without what is no number."""
    values = [value if math.isfinite(value) else None for value in losses["values"]]
    return {"every": int(losses["every"]), "values": values}


def pictures_of(folder: Path) -> list[dict[str, str]]:
    """The pictures in the folder of a run that a page may show; a link to elsewhere is none of them."""
    found = []
    for pattern, label, is_latest in PICTURES:
        paths = sorted(path for path in folder.glob(pattern) if _is_its_own(path, folder))
        for path in paths[-1:] if is_latest else paths:
            number = path.stem.rpartition("-")[2] if "*" in pattern and not is_latest else ""
            state = path.stat()
            version = f"{state.st_mtime_ns}-{state.st_size}"
            name = path.relative_to(folder).as_posix()
            found.append({"name": name, "label": f"{label} {number}".rstrip(), "version": version})
    return found


def _is_its_own(path: Path, folder: Path) -> bool:
    inside = path.resolve().is_relative_to(folder.resolve())
    return inside and path.is_file() and path.stat().st_size <= MOST_BYTES


def picture_in(folder: Path, name: str) -> bytes | None:
    """A picture of the run by its name; None for any other name."""
    if all(picture["name"] != name for picture in pictures_of(folder)):
        return None
    return (folder / name).read_bytes()
