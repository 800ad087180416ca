"""How well `diff3ds views` finds the edges of objects, with its defaults: F-scores, curves, circles and times.

    python benchmarks/views.py cad OUT [--seeds 0-29] [--target edges] [--every 1]   generated objects
    python benchmarks/views.py folder OUT FOLDER... [--target edges] [--every 1]      folders like ABC-NEF
    python benchmarks/views.py robust OUT [--seeds 0-4]                               damaged pictures and cameras

A folder holds transforms_edges.json, transforms_color.json and ground_truth.json, with the longest side of the object
as the unit of length. Each run is the command that a user would give, in a process of its own. Writes OUT/views.json.
"""

import argparse
import json
import platform
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from curve_scores import score
from damage import DAMAGES, damaged, thinned_out

RESULT = "sketch.json"


def main() -> None:
    """Runs what the command line asks for, prints a table and writes the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mode", choices=["cad", "folder", "robust"])
    parser.add_argument("out", type=Path)
    parser.add_argument("folders", type=Path, nargs="*")
    parser.add_argument("--seeds", default="0-29")
    parser.add_argument("--target", choices=["edges", "color-edges"], default="edges")
    parser.add_argument("--init", choices=["carve", "random"], default="carve")
    parser.add_argument("--every", type=int, default=1, help="use every so manieth view")
    options = parser.parse_args()
    folders = options.folders or [_generated(options.out, seed) for seed in _seeds(options.seeds)]
    if options.mode == "robust":
        rows = [_damaged_row(name, folder, options) for name in DAMAGES for folder in folders]
    else:
        rows = [_row(folder, options) for folder in folders]
    for group in dict.fromkeys(row["damage"] for row in rows):
        _print_summary(group, [row for row in rows if row["damage"] == group])
    about = {"command": " ".join(["python", *sys.argv]), "commit": _commit(), "machine": _machine(), "rows": rows}
    (options.out / "views.json").write_text(json.dumps(about, indent=1))


def _seeds(text: str) -> list[int]:
    first, _, last = text.partition("-")
    return list(range(int(first), int(last or first) + 1))


def _generated(out: Path, seed: int) -> Path:
    from cad_objects import generate

    folder = out / "objects" / f"{seed:02}"
    if not (folder / "ground_truth.json").is_file():
        generate(seed, folder)
    return folder


def _row(folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    source = thinned_out(folder, options.target, options.every, options.out / "views" / folder.name)
    return _scored(folder.name, folder, source, options, "")


def _damaged_row(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    source = damaged(name, folder, options.target, options.out / "damaged" / name / folder.name)
    return _scored(folder.name, folder, source, options, name)


def _scored(name: str, folder: Path, source: Path, options: argparse.Namespace, damage: str) -> dict[str, Any]:
    """One run of the command and its scores."""
    out = options.out / "sketches" / (damage or "plain") / name
    command = [sys.executable, "-m", "diff3ds.cli", "views", str(source), "-o", str(out), "--quiet", "--overwrite"]
    begun = time.perf_counter()
    done = subprocess.run(
        [*command, "--target", options.target, "--init", options.init], capture_output=True, text=True, check=False
    )
    row: dict[str, Any] = {"object": name, "damage": damage, "seconds": time.perf_counter() - begun}
    if done.returncode:
        row |= {"F5": 0.0, "error": done.stderr.strip()[-300:]}
        print(f"{name:10} {damage:14} {row['error']}", flush=True)
        return row
    truth = json.loads((folder / "ground_truth.json").read_text())
    row |= score(json.loads((out / RESULT).read_text()), truth)
    row["bias"] = json.loads((out / "run.json").read_text())["bias_pixels"]
    print(_line(row), flush=True)
    return row


def _line(row: dict[str, Any]) -> str:
    circles = f"{row['circles_exact']}/{row['circles']}" if row.get("circles") else "-"
    return (
        f"{row['object']:10} {row['damage']:14} F5 {row['F5']:.3f}  F10 {row['F10']:.3f}  acc {row['acc_mm']:5.2f}  "
        f"comp {row['comp_mm']:5.2f}  curves {row['curves_joined']}/{row['curves_truth']}  circles {circles}  "
        f"{row['seconds']:.0f} s"
    )


def _print_summary(damage: str, rows: list[dict[str, Any]]) -> None:
    scores = [row["F5"] for row in rows]
    errors = [row["radius_error_median"] for row in rows if row.get("radius_error_median") is not None]
    total = {key: sum(row.get(key) or 0 for row in rows) for key in ("circles_exact", "circles_radius", "circles")}
    print(
        f"{damage or 'all'}: {len(rows)} runs, F5 mean {statistics.mean(scores):.3f}, worst {min(scores):.3f}, "
        f"failed {sum('error' in row for row in rows)}, circles exact and within .5 % {total['circles_exact']} of "
        f"{total['circles']} ({total['circles_radius']} by the radius alone)"
        + (f", radius error {statistics.median(errors):.2f} % (median)" if errors else "")
    )


def _commit() -> str:
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    return done.stdout.strip()


def _machine() -> str:
    import diff3ds

    return f"{platform.processor() or platform.machine()}, {diff3ds.get_num_threads()} threads"


if __name__ == "__main__":
    main()
