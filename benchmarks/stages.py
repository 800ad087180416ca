"""Time of each stage of `diff3ds views`, and its peak memory: `python benchmarks/stages.py FOLDER [options of views]`.

The run is the command that a user would give, in a process of its own. Times are those on the clock, and those of the
processor, which other work on the machine changes little. Reading includes what is found out from the pictures; what
is left over is start and writing.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from report import show

# Of the largest child, in kB but on macOS.
UNIT = 1 if sys.platform == "darwin" else 1024


def main() -> None:
    """Runs `diff3ds views` and prints a row for each stage."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path, help="a transforms.json, or a folder with one")
    source, rest = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        begun = time.perf_counter()
        command = [sys.executable, "-m", "diff3ds.cli", "views", str(source.source), "-o", str(out), *rest]
        subprocess.run(command, check=True)
        clock = time.perf_counter() - begun
        run = json.loads((out / "run.json").read_text())
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * UNIT / 1e6
    rows = [[name, spent["seconds"], spent["processor"]] for name, spent in run["stages"].items()]
    told = [sum(row[column] for row in rows) for column in (1, 2)]
    rows += [["start, writing", round(clock - told[0], 3), round(processor - told[1], 3)]]
    rows += [["all", round(clock, 3), round(processor, 3)]]
    show(f"{source.source}: peak memory {peak:.0f} MB, scores {run['scores']}", ("stage", "seconds", "processor"), rows)


if __name__ == "__main__":
    main()
