"""The tables of what becomes of pictures, phrases, views and meshes, as text for docs/results."""

import re
import statistics
from collections.abc import Callable
from typing import Any

from sensitivity import NAMED, changes
from tables_format import about_run, command, digits, link_to, markdown, percent, results_of, source_of

NEAR = ("missing", "extra", "chamfer", "before_chamfer", "contours_chamfer")
NEAR += ("doodle_missing", "doodle_extra", "doodle_chamfer")


def edges() -> str:
    """Objects that others have published, and generated parts."""
    rows = []
    for run in results_of("views")["runs"]:
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
        rows += [[*cell, f"`{command(run['command'])}`", f"`{run['commit']}`"] for cell in cells]
    head = ["object", "F-score at 5 mm", "curves / of the truth", "command", "commit"]
    return markdown(head, rows) + f"\n*2 cores of an AMD EPYC (AVX-512); {link_to('views')}*\n"


def circles() -> str:
    """Exact circles and arcs of the generated parts."""
    rows = []
    for run in results_of("views")["runs"]:
        if "cad" in run["command"]:
            seeds = re.search(r"--seeds ([\d-]+)", run["command"])
            sums = [sum(row[k] for row in run["rows"]) for k in ("circles", "circles_radius", "circles_exact")]
            rows.append([seeds[1] if seeds else "", *sums])
    head = ["parts", "circles and arcs", "found, with a radius within .5 %", "centre within 1 % as well"]
    return markdown(head, rows) + f"\n*From the same runs; {link_to('views')}*\n"


def damage() -> str:
    """One object, its pictures damaged."""
    (run,) = [run for run in results_of("views")["runs"] if " robust " in run["command"]]
    rows = [
        [row["damage"], f"{row['F5']:.3f}", f"{row['curves_joined']} / {row['curves_truth']}"] for row in run["rows"]
    ]
    about = f"\n*{run['machine']}; commit `{run['commit']}`, `{run['command']}`; {link_to('views')}*\n"
    return markdown(["damage", "F-score at 5 mm", "curves / of the truth"], rows) + about


def color() -> str:
    """Coloured strokes by depth and by order of creation."""
    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for row in results_of("color_views")["figures"]["rows"]:
        rows.setdefault((row["scene"], row["strokes"]), {})[row["order"]] = row
    cells = []
    for (scene, strokes), by in rows.items():
        depth, creation = by["depth"], next(row for order, row in by.items() if order != "depth")
        cells.append([scene, f"{strokes:,}", f"{depth['psnr']:.1f}", f"{depth['ssim']:.3f}",
                      f"{creation['psnr']:.1f}", f"{creation['ssim']:.3f}", f"{depth['seconds']:.0f}"])  # fmt: skip
    head = ["scene", "strokes", "PSNR by depth, dB", "SSIM", "PSNR by creation, dB", "SSIM", "s, by depth"]
    return markdown(head, cells) + source_of("color_views")


def categories() -> str:
    """Every kind by the built-in prior."""
    return _kinds("categories")


def clean_strokes() -> str:
    """What an eye minds, above what the member most like a sketch has by right."""
    rows = [
        [f"**{kind}**" if kind == "all" else kind]
        + [digits(row[name]) for name in ("descent_above", "result_above", "descent_strokes", "result_strokes")]
        for kind, row in sorted(results_of("clean_strokes")["figures"].items(), key=lambda item: item[0] != "all")
    ]
    head = ["kind", "as the descent leaves it", "as the result is", "strokes before", "and then"]
    return markdown(head, rows) + source_of("clean_strokes")


def follow_drawings() -> str:
    """Members that are bent towards drawings by people."""
    read = results_of("follow_drawings")["figures"]
    rows = [
        [said, *(f"{read[before][k]:.2f} to {read[after][k]:.2f}" for k in ("mean", "median", "worst"))]
        for said, before, after in (
            ("F-score at 3 pixels of 256", "F", "F_bent"),
            ("drawing with a stroke within 3 pixels", "recall", "recall_bent"),
        )
    ]
    head = [f"{read['drawings']} drawings, before to after", "mean", "median", "worst"]
    return markdown(head, rows) + source_of("follow_drawings")


def meshes() -> str:
    """Feature curves of triangulated parts."""
    read = results_of("meshes")["figures"]
    rows = [
        ["F-score at 5 mm of one metre, mean (worst)", f"{read['F5_mean']:.3f} ({read['F5_worst']:.3f})"],
        ["curves for each true edge", f"{read['curves_per_edge']:.2f}"],
        ["circles found, with radius and centre", f"{read['circles_found']} of {read['circles']}"],
        ["faces, mean", f"{read['faces_mean']:,.0f}"],
        ["processor seconds, mean", digits(read["seconds_mean"])],
    ]
    return markdown([f"{len(read['rows'])} parts", ""], rows) + source_of("meshes")


def smooth_meshes() -> str:
    """Strokes of smooth meshes against their drawings."""
    rows = [
        [row["mesh"], row["strokes"], row["cubics"], *(f"{row[name]:.1f}" for name in NEAR), f"{row['seconds']:.0f}"]
        for row in results_of("smooth_meshes")["figures"]["rows"]
    ]
    head = [
        "", "strokes", "cubics", "line to stroke", "stroke to line", "mean", "before the fit", "with contours",
        "3Doodle's way: line to stroke", "stroke to line", "mean", "seconds",
    ]  # fmt: skip
    return markdown(head, rows) + source_of("smooth_meshes")


def hidden_lines() -> str:
    """Hidden lines beside OCCT's."""
    rows = [
        [
            row["solid"], f"{row['faces']:,}", f"{row['first']:.2f}", f"{row['view']:.3f}", f"{row['occt']:.3f}",
            f"{row['ratio']:.1f}",
        ]
        for row in results_of("hidden_lines")["figures"]["rows"]
    ]  # fmt: skip
    head = ["solid", "faces", "first view, s", "a further view, s", "OCCT, s", "further view / OCCT"]
    return markdown(head, rows) + source_of("hidden_lines")


def categories_small() -> str:
    """Every kind by the small network."""
    return _kinds("categories_small")


def combinations_small() -> str:
    """Combinations of attributes by the small network."""
    rows = [
        [
            name,
            percent(row["top1"]),
            percent(row["views"]),
            f"{row['F5']:.2f} ({row['F5_worst']:.2f})",
            f"{row['F2']:.2f}",
            f"{row['chamfer_percent']:.2f}",
        ]
        for name, row in results_of("combinations_small")["figures"].items()
    ]
    head = ["combinations", "named rightly", "from one side", "F at 5 % (worst)", "F at 2 %", "mean distance, %"]
    return markdown(head, rows) + source_of("combinations_small")


def ablations() -> str:
    """One thing changed at a time in a run of the built-in prior."""
    rows = [
        [name, f"{row['F5']:.2f} ({row['F5_worst']:.2f})", f"{row['F2']:.2f}", f"{row['strokes']:.0f}"]
        for name, row in results_of("ablations")["figures"].items()
    ]
    return markdown(["change", "F at 5 % (worst)", "F at 2 %", "strokes left"], rows) + source_of("ablations")


def known_answer() -> str:
    """The paper's recipe, distilled from a prior of eight sketches."""
    part = results_of("distill")["shapes"]
    rows = [
        [name, f"{row['F5']:.2f}", f"{row['F2']:.2f}", f"{row['chamfer_percent']:.1f}", row["strokes"]]
        for name, row in part["figures"].items()
    ]
    head = ["shape", "F at 5 %", "F at 2 %", "mean distance, % of the longest side", "strokes left"]
    return markdown(head, rows) + about_run(part["environment"], "distill")


def known_answer_ablations() -> str:
    """One thing changed at a time in the paper's recipe."""
    part = results_of("distill")["ablations"]
    rows = [
        [name, f"{row['F5']:.2f}", f"{row['F2']:.2f}", f"{row['strokes']:.0f}"] for name, row in part["figures"].items()
    ]
    return markdown(["change", "F at 5 %", "F at 2 %", "strokes left"], rows) + about_run(
        part["environment"], "distill"
    )


def recognised() -> str:
    """Drawings recognised."""
    keys = ("category", "and_attributes", "and_pose", "and_pose_or_looks_the_same", "taken", "taken_but_wrong")
    part = results_of("recognise")["figures"]["recognised"]
    rows = [[name, row["pictures"], *(percent(row[key]) for key in keys)] for name, row in part["conditions"].items()]
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
    return markdown(head, rows) + about_run(
        {**results_of("recognise")["environment"], "commit": part["commit"], "command": part["command"]}, "recognise"
    )


def by_people() -> str:
    """Drawings by people recognised, before there was a network and with it."""
    read = results_of("drawings_by_people")
    keys = ("first", "among_three", "taken", "wrong_among_taken")
    rows = [
        [f"{name}, {of}", part[of]["drawings"], *(percent(part[of][key]) for key in keys)]
        for name, part in read["figures"].items()
        for of in ("all", "understood")
    ]
    head = ["drawings", "of", "right kind first", "among three", "taken", "wrong among taken"]
    rows += [
        [f"{name}, {of}", part[of]["of"], "", "", percent(part[of]["taken"] / part[of]["of"]), ""]
        for of in ("doodles", "icons")
        for name, part in read["figures"].items()
        if part.get(of, {}).get("of")
    ]
    about = {**read["environment"], "commit": read["figures"]["after"]["commit"]}
    return markdown(head, rows) + about_run(about, "drawings_by_people")


def drawn_again() -> str:
    """Sketches made of drawings, compared with what was drawn."""
    keys = ("F5", "F2", "chamfer_percent", "view_F5", "view_chamfer_percent", "view_error")
    figures = results_of("recognise")["figures"]["sketches"]
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
    about = {**results_of("recognise")["environment"], "commit": figures["commit"], "command": figures["command"]}
    return markdown(head, rows) + about_run(about, "recognise")


def sensitivity() -> str:
    """The constants of edges that change the F-score most."""
    read = results_of("sensitivity")
    rows = changes(read["F5"])
    table = [[f"`{name}`", *(f"{1000 * value:+.0f}" for value in (less, more))] for name, less, more in rows[:NAMED]]
    parts = {part for scores in read["F5"].values() for part in scores}
    still = sum(abs(less) < 0.0005 and abs(more) < 0.0005 for _, less, more in rows)
    about = (
        f"Measured so far: {len(rows)} of {read['constants']} constants, each on one of the generated parts "
        f"{' and '.join(sorted(parts))}, with every {read['every']}th view; {still} of them change the F-score by "
        f"less than .0005. {'; '.join(f'`{line}`' for line in read['command'])}; commit `{read['commit']}`; "
        f"{read['machine']}; {link_to('sensitivity')}"
    )
    return markdown(["constant", "F-score × 1000, constant × 0.7", "× 1.4"], table) + f"\n*{about}*\n"


def _kinds(file: str) -> str:
    rows = [
        [f"**{name}**" if name == "all" else name, percent(row["top1"]), percent(row["views"]),
         f"{row['F5']:.2f} ({row['F5_worst']:.2f})", f"{row['F2']:.2f}",
         f"{row['chamfer_percent']:.2f} ({row['fresh_chamfer_percent']:.2f})", f"{row['strokes']:.0f}"]
        for name, row in sorted(results_of(file)["figures"].items(), key=lambda item: item[0] != "all")
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
    return markdown(head, rows) + source_of(file)


TABLES: tuple[Callable[[], str], ...] = (
    edges, circles, damage, sensitivity, color,
    categories, categories_small, combinations_small, ablations, known_answer, known_answer_ablations, recognised,
    by_people, drawn_again, follow_drawings, meshes, smooth_meshes, hidden_lines, clean_strokes,
)  # fmt: skip
