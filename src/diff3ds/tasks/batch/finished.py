"""Whether the run in a folder is done: run.json, which is written last and renamed into its place, says so."""

from pathlib import Path
from typing import Any

from diff3ds._files import read_json


def run_record(folder: Path) -> dict[str, Any] | None:
    """What run.json says of a run that came to its end; None of any other."""
    try:
        content = read_json(folder / "run.json")
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return None
    return content if isinstance(content, dict) and content.get("stopped_early") is False else None


def is_finished(folder: Path) -> bool:
    """Whether a run came to its end."""
    return run_record(folder) is not None
