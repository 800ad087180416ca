"""Writes the tables of docs/results from benchmarks/results, each with its machine, commit and command.

    python benchmarks/tables.py

A table stands between `<!-- table NAME -->` and `<!-- end -->`, NAME being a function below; all else on the pages is
written by hand.
"""

import json
import re
import statistics
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from sensitivity import NAMED, changes

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs/results"
FILES = ROOT / "benchmarks/results"
WORKLOADS = {
    "A": "56 strokes, 4 views of 512²",
    "B": "1,024 strokes, 1 view of 1024²",
    "C": "56 strokes, 4 views of 64²",
    "D": "2,048 strokes, 1 view of 2040×1344",
}
MACHINES = ("render", "render_epyc_slow", "render_avx2", "render_xeon")
BOTH = "forward + backward"
NEAR = ("missing", "extra", "chamfer", "before_chamfer", "contours_chamfer")


def speed() -> str:
    """Milliseconds of the renderer."""
    figures = _read("render")["figures"]
    rows = []
    for key, name in WORKLOADS.items():
        one, two = (figures["ms"][key][threads] for threads in "12")
        rows += [[f"**{key}**: {name}", "forward", _digits(one["forward"][0]), _digits(two["forward"][0]),
                  _digits(figures["reference_ms"][key]["forward"])],
                 ["", BOTH, _digits(one[BOTH][0]), _digits(two[BOTH][0]), _digits(figures["reference_ms"][key][BOTH])],
                 ["", f"Monte Carlo, 2×2, {BOTH}", *(_digits(t[f"Monte Carlo {BOTH}"][0]) for t in (one, two)), ""],
                 ["", "memory above the images, MB", _digits(figures["memory_mb"][key]), "", ""]]  # fmt: skip
    return _table(["workload", "ms of", "1 thread", "2 threads", "the reference in PyTorch"], rows) + _source("render")


def machines() -> str:
    """The renderer and a bare kernel on several machines."""
    rows = []
    for file in MACHINES:
        read = _read(file)
        about, ms = read["environment"], read["figures"]["ms"]
        for key in "ABC":
            times = ms[key]["1"]
            rows.append([f"{about['cpu']}, {about['instruction_set']}, {_link(file)}" if key == "A" else "", key])
            for what in ("forward", BOTH):
                ours, bare = times[what][0], times[f"prototype {what}"][0]
                rows[-1] += [_digits(ours), f"{_digits(bare)} ({100 * bare / ours:.0f} %)"]
    head = ["machine, 1 thread", "", "forward, ms", "bare kernel", f"{BOTH}, ms", "bare kernel"]
    return _table(head, rows)


def step_cost() -> str:
    """What is not the prior in a step of distillation."""
    rows = [
        [
            name,
            _digits(row["ms"][0]),
            f"{row['percent_of_published_step']:.2f}" if row["percent_of_published_step"] else "",
        ]
        for name, row in _read("step_cost")["figures"].items()
    ]
    return _table(["prior", "ms a step without the network", "% of the published time of a step"], rows) + _source(
        "step_cost"
    )


def compile_cuda() -> str:
    """Seconds that NVRTC takes for the CUDA kernels."""
    figures = _read("compile_cuda")["figures"]
    parts = list(next(iter(figures.values())))
    rows = [[part, *(f"{figures[sm][part]:.2f}" for sm in figures)] for part in parts]
    return _table(["seconds for", *figures], rows) + _source("compile_cuda")


def agreement() -> str:
    """Pictures and gradients of the kernels and of the reference."""
    kernels = _read("accuracy")["figures"]["kernels"]
    text = (
        f"Of {kernels['ink']:,} pixels with ink in {kernels['scenes']} random scenes, {100 * kernels['within']:.3f} % "
        f"are within 1e-4, and {100 * kernels['depth_within']:.2f} % of their depths. The worst pixel is off by "
        f"{max(pixel['error'] for pixel in kernels['worst']):.4f}.\n\n"
    )
    columns = list(kernels["gradients"])
    rows = [
        [
            f"`{name}`",
            *(
                _power(kernels["gradients"][c][name]["error"]) if name in kernels["gradients"][c] else ""
                for c in columns
            ),
        ]
        for name in kernels["gradients"][columns[0]]
    ]
    return text + _table(["relative error of the gradient to", *columns], rows) + _source("accuracy")


def differences() -> str:
    """Gradients of the reference against finite differences."""
    rows = [
        [name, row["directions"], row["bent"], _power(row["median"]), _power(row["worst"])]
        for name, row in _read("accuracy")["figures"]["gradients"].items()
    ]
    return _table(["of / to", "directions", "left out: bent", "median error", "worst"], rows) + _source("accuracy")


def edges() -> str:
    """Objects that others have published, and generated parts."""
    rows = []
    for run in _read("views")["runs"]:
        if " robust " in run["command"]:
            continue
        found = run["rows"]
        many = len(found) > 2
        scores = [row["F5"] for row in found]
        ratio = statistics.median(row["curves_joined"] / row["curves_truth"] for row in found)
        if many:
            cells = [
                [
                    f"{len(found)} generated parts",
                    f"{statistics.mean(scores):.3f} (worst {min(scores):.3f})",
                    f"{ratio:.2f} × (median)",
                ]
            ]
        else:
            cells = [
                [f"ABC {r['object']}", f"{r['F5']:.3f}", f"{r['curves_joined']} / {r['curves_truth']}"] for r in found
            ]
        rows += [[*cell, f"`{_command(run['command'])}`", f"`{run['commit']}`"] for cell in cells]
    head = ["object", "F-score at 5 mm", "curves / of the truth", "command", "commit"]
    return _table(head, rows) + f"\n*2 cores of an AMD EPYC (AVX-512); {_link('views')}*\n"


def circles() -> str:
    """Exact circles and arcs of the generated parts."""
    rows = []
    for run in _read("views")["runs"]:
        if "cad" in run["command"]:
            seeds = re.search(r"--seeds ([\d-]+)", run["command"])
            sums = [sum(row[k] for row in run["rows"]) for k in ("circles", "circles_radius", "circles_exact")]
            rows.append([seeds[1] if seeds else "", *sums])
    head = ["parts", "circles and arcs", "found, with a radius within .5 %", "centre within 1 % as well"]
    return _table(head, rows) + f"\n*From the same runs; {_link('views')}*\n"


def damage() -> str:
    """One object, its pictures damaged."""
    (run,) = [run for run in _read("views")["runs"] if " robust " in run["command"]]
    rows = [
        [row["damage"], f"{row['F5']:.3f}", f"{row['curves_joined']} / {row['curves_truth']}"] for row in run["rows"]
    ]
    about = f"\n*{run['machine']}; commit `{run['commit']}`, `{run['command']}`; {_link('views')}*\n"
    return _table(["damage", "F-score at 5 mm", "curves / of the truth"], rows) + about


def color() -> str:
    """Coloured strokes by depth and by order of creation."""
    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for row in _read("color_views")["figures"]["rows"]:
        rows.setdefault((row["scene"], row["strokes"]), {})[row["order"]] = row
    cells = []
    for (scene, strokes), by in rows.items():
        depth, creation = by["depth"], next(row for order, row in by.items() if order != "depth")
        cells.append([scene, f"{strokes:,}", f"{depth['psnr']:.1f}", f"{depth['ssim']:.3f}",
                      f"{creation['psnr']:.1f}", f"{creation['ssim']:.3f}", f"{depth['seconds']:.0f}"])  # fmt: skip
    head = ["scene", "strokes", "PSNR by depth, dB", "SSIM", "PSNR by creation, dB", "SSIM", "s, by depth"]
    return _table(head, cells) + _source("color_views")


def categories() -> str:
    """Every kind by the built-in prior."""
    return _kinds("categories")


def clean_strokes() -> str:
    """What an eye minds, above what the member most like a sketch has by right."""
    rows = [
        [f"**{kind}**" if kind == "all" else kind]
        + [_digits(row[name]) for name in ("descent_above", "result_above", "descent_strokes", "result_strokes")]
        for kind, row in sorted(_read("clean_strokes")["figures"].items(), key=lambda item: item[0] != "all")
    ]
    head = ["kind", "as the descent leaves it", "as the result is", "strokes before", "and then"]
    return _table(head, rows) + _source("clean_strokes")


def follow_drawings() -> str:
    """Members that are bent towards drawings by people."""
    read = _read("follow_drawings")["figures"]
    rows = [
        [said, *(f"{read[before][k]:.2f} to {read[after][k]:.2f}" for k in ("mean", "median", "worst"))]
        for said, before, after in (
            ("F-score at 3 pixels of 256", "F", "F_bent"),
            ("drawing with a stroke within 3 pixels", "recall", "recall_bent"),
        )
    ]
    head = [f"{read['drawings']} drawings, before to after", "mean", "median", "worst"]
    return _table(head, rows) + _source("follow_drawings")


def meshes() -> str:
    """Feature curves of triangulated parts."""
    read = _read("meshes")["figures"]
    rows = [
        ["F-score at 5 mm of one metre, mean (worst)", f"{read['F5_mean']:.3f} ({read['F5_worst']:.3f})"],
        ["curves for each true edge", f"{read['curves_per_edge']:.2f}"],
        ["circles found, with radius and centre", f"{read['circles_found']} of {read['circles']}"],
        ["faces, mean", f"{read['faces_mean']:,.0f}"],
        ["processor seconds, mean", _digits(read["seconds_mean"])],
    ]
    return _table([f"{len(read['rows'])} parts", ""], rows) + _source("meshes")


def smooth_meshes() -> str:
    """Strokes of smooth meshes against their drawings."""
    rows = [
        [row["mesh"], row["strokes"], *(f"{row[name]:.1f}" for name in NEAR), f"{row['seconds']:.0f}"]
        for row in _read("smooth_meshes")["figures"]["rows"]
    ]
    head = ["", "strokes", "line to stroke", "stroke to line", "mean", "before the fit", "with contours", "seconds"]
    return _table(head, rows) + _source("smooth_meshes")


def categories_small() -> str:
    """Every kind by the small network."""
    return _kinds("categories_small")


def combinations_small() -> str:
    """Combinations of attributes by the small network."""
    rows = [
        [
            name,
            _percent(row["top1"]),
            _percent(row["views"]),
            f"{row['F5']:.2f} ({row['F5_worst']:.2f})",
            f"{row['F2']:.2f}",
            f"{row['chamfer_percent']:.2f}",
        ]
        for name, row in _read("combinations_small")["figures"].items()
    ]
    head = ["combinations", "named rightly", "from one side", "F at 5 % (worst)", "F at 2 %", "mean distance, %"]
    return _table(head, rows) + _source("combinations_small")


def ablations() -> str:
    """One thing changed at a time in a run of the built-in prior."""
    rows = [
        [name, f"{row['F5']:.2f} ({row['F5_worst']:.2f})", f"{row['F2']:.2f}", f"{row['strokes']:.0f}"]
        for name, row in _read("ablations")["figures"].items()
    ]
    return _table(["change", "F at 5 % (worst)", "F at 2 %", "strokes left"], rows) + _source("ablations")


def known_answer() -> str:
    """The paper's recipe, distilled from a prior of eight sketches."""
    part = _read("distill")["shapes"]
    rows = [
        [name, f"{row['F5']:.2f}", f"{row['F2']:.2f}", f"{row['chamfer_percent']:.1f}", row["strokes"]]
        for name, row in part["figures"].items()
    ]
    head = ["shape", "F at 5 %", "F at 2 %", "mean distance, % of the longest side", "strokes left"]
    return _table(head, rows) + _about(part["environment"], "distill")


def known_answer_ablations() -> str:
    """One thing changed at a time in the paper's recipe."""
    part = _read("distill")["ablations"]
    rows = [
        [name, f"{row['F5']:.2f}", f"{row['F2']:.2f}", f"{row['strokes']:.0f}"] for name, row in part["figures"].items()
    ]
    return _table(["change", "F at 5 %", "F at 2 %", "strokes left"], rows) + _about(part["environment"], "distill")


def recognised() -> str:
    """Drawings recognised."""
    keys = ("category", "and_attributes", "and_pose", "and_pose_or_looks_the_same", "taken", "taken_but_wrong")
    part = _read("recognise")["figures"]["recognised"]
    rows = [[name, row["pictures"], *(_percent(row[key]) for key in keys)] for name, row in part["conditions"].items()]
    head = [
        "drawing",
        "pictures",
        "category",
        "and attributes",
        "and pose",
        "or looks the same",
        "taken",
        "taken, and wrong",
    ]
    return _table(head, rows) + _about(
        {**_read("recognise")["environment"], "commit": part["commit"], "command": part["command"]}, "recognise"
    )


def by_people() -> str:
    """Drawings by people recognised, before there was a network and with it."""
    read = _read("drawings_by_people")
    keys = ("first", "among_three", "taken", "wrong_among_taken")
    rows = [
        [f"{name}, {of}", part[of]["drawings"], *(_percent(part[of][key]) for key in keys)]
        for name, part in read["figures"].items()
        for of in ("all", "understood")
    ]
    head = ["drawings", "of", "right kind first", "among three", "taken", "wrong among taken"]
    rows += [
        [f"{name}, {of}", part[of]["of"], "", "", _percent(part[of]["taken"] / part[of]["of"]), ""]
        for of in ("doodles", "icons")
        for name, part in read["figures"].items()
        if part.get(of, {}).get("of")
    ]
    about = {**read["environment"], "commit": read["figures"]["after"]["commit"]}
    return _table(head, rows) + _about(about, "drawings_by_people")


def drawn_again() -> str:
    """Sketches made of drawings, compared with what was drawn."""
    keys = ("F5", "F2", "chamfer_percent", "view_F5", "view_chamfer_percent", "view_error")
    figures = _read("recognise")["figures"]["sketches"]
    rows = [
        [name.split(",")[0], *(f"{row['mean'][key]:.2f}" for key in keys)]
        for name, row in figures.items()
        if isinstance(row, dict)
    ]
    head = [
        "drawing",
        "F at 5 %",
        "F at 2 %",
        "mean distance, %",
        "F at 5 % in the view",
        "distance there, %",
        "error of pixels",
    ]
    about = {**_read("recognise")["environment"], "commit": figures["commit"], "command": figures["command"]}
    return _table(head, rows) + _about(about, "recognise")


def sensitivity() -> str:
    """The constants of edges that change the F-score most."""
    read = _read("sensitivity")
    rows = changes(read["F5"])
    table = [[f"`{name}`", *(f"{1000 * value:+.0f}" for value in (less, more))] for name, less, more in rows[:NAMED]]
    parts = {part for scores in read["F5"].values() for part in scores}
    still = sum(abs(less) < 0.0005 and abs(more) < 0.0005 for _, less, more in rows)
    about = (
        f"Measured so far: {len(rows)} of {read['constants']} constants, each on one of the generated parts "
        f"{' and '.join(sorted(parts))}, with every {read['every']}th view; {still} of them change the F-score by "
        f"less than .0005. {'; '.join(f'`{line}`' for line in read['command'])}; commit `{read['commit']}`; "
        f"{read['machine']}; {_link('sensitivity')}"
    )
    return _table(["constant", "F-score × 1000, constant × 0.7", "× 1.4"], table) + f"\n*{about}*\n"


TABLES: tuple[Callable[[], str], ...] = (
    speed, machines, step_cost, compile_cuda, agreement, differences, edges, circles, damage, sensitivity, color,
    categories, categories_small, combinations_small, ablations, known_answer, known_answer_ablations, recognised,
    by_people, drawn_again, follow_drawings, meshes, smooth_meshes, clean_strokes,
)  # fmt: skip


def page(path: Path) -> str:
    """A page with its tables made anew."""
    made = {table.__name__: table for table in TABLES}
    pattern = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
    return pattern.sub(lambda found: f"{found[1]}\n{made[found[2]]()}\n{found[3]}", path.read_text(encoding="utf-8"))


def _kinds(file: str) -> str:
    rows = [
        [f"**{name}**" if name == "all" else name, _percent(row["top1"]), _percent(row["views"]),
         f"{row['F5']:.2f} ({row['F5_worst']:.2f})", f"{row['F2']:.2f}",
         f"{row['chamfer_percent']:.2f} ({row['fresh_chamfer_percent']:.2f})", f"{row['strokes']:.0f}"]
        for name, row in sorted(_read(file)["figures"].items(), key=lambda item: item[0] != "all")
    ]  # fmt: skip
    head = [
        "kind",
        "named rightly",
        "from one side",
        "F at 5 % (worst)",
        "F at 2 %",
        "mean distance (of fresh members), %",
        "strokes",
    ]
    return _table(head, rows) + _source(file)


def _read(name: str) -> dict[str, Any]:
    read: dict[str, Any] = json.loads((FILES / f"{name}.json").read_text(encoding="utf-8"))
    return read


def _table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def _source(name: str) -> str:
    return _about(_read(name)["environment"], name)


def _about(environment: dict[str, Any], name: str) -> str:
    """Machine, commit and command of a table."""
    given = environment["command"]
    commands = "; ".join(f"`{_command(line)}`" for line in ([given] if isinstance(given, str) else given))
    machine = f"{environment['cores']} cores of an {environment['cpu']} ({environment['instruction_set']})"
    note = f"; {environment['note']}" if "note" in environment else ""
    commit = re.sub(r"\b(?=\w*\d)[0-9a-f]{7,12}(-dirty)?", r"`\g<0>`", environment["commit"])
    return f"\n*{machine}; PyTorch {environment['torch']}; commit {commit}; {commands}{note}; {_link(name)}*\n"


def _command(line: str) -> str:
    """A command without the run's own file names."""
    line = re.sub(r" --json \S+| \(as two runs.*\)", "", line)
    return line if "benchmarks/" in line else line.replace("python ", "python benchmarks/", 1)


def _link(name: str) -> str:
    return f"[{name}.json](../../benchmarks/results/{name}.json)"


def _digits(value: float) -> str:
    """Two significant digits, three from 100 on."""
    if value >= 100:
        return f"{float(f'{value:.3g}'):,.0f}"
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def _power(value: float) -> str:
    return f"{value:.1e}".replace("e-0", "e-")


def _percent(value: float) -> str:
    return f"{100 * value:.0f} %"


if __name__ == "__main__":
    for file in sorted(PAGES.glob("*.md")):
        text = page(file)
        file.write_text(text, encoding="utf-8")
        print(file.relative_to(ROOT))
