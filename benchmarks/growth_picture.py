"""Draws docs/pictures/growth.svg from benchmarks/results/growth.json: `python benchmarks/growth_picture.py`.

Processor seconds of each job over its size, as times the usual one; both axes are logarithmic.
"""

import math
from pathlib import Path

from tables_format import results_of

OUT = Path(__file__).parents[1] / "docs/pictures/growth.svg"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 460, 56, 190, 16, 44
# Okabe and Ito's colours, which all eyes tell apart, twice: the second time dashed.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
# Pixels between names beside the curves.
APART = 15


def picture() -> str:
    """The SVG."""
    jobs = {name: job for name, job in results_of("growth")["figures"]["jobs"].items() if job["rows"]}
    seconds = [row["processor"] for job in jobs.values() for row in job["rows"]]
    low, high = math.floor(math.log10(min(seconds))), math.ceil(math.log10(max(seconds)))
    # Usual sizes to a hundred times those: two decades.
    across, up = (WIDTH - LEFT - RIGHT) / 2, (HEIGHT - TOP - BOTTOM) / (high - low)

    def x(times: float) -> float:
        return LEFT + across * math.log10(times)

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - up * (math.log10(value) - low)

    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
             f'font-size="12"><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>']  # fmt: skip
    for times, label in ((1, "usual"), (10, "10 times"), (100, "100 times")):
        parts.append(f'<path d="M{x(times):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        parts.append(f'<text x="{x(times):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{label}</text>')
    for power in range(low, high + 1):
        parts.append(f'<path d="M{LEFT} {y(10**power):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y(10**power) + 4:.1f}" text-anchor="end">{10.0**power:g} s</text>')
    ends = sorted(jobs, key=lambda name: jobs[name]["rows"][-1]["processor"], reverse=True)
    beside = -math.inf
    for name in ends:
        index, rows = list(jobs).index(name), jobs[name]["rows"]
        color, dashes = COLORS[index % len(COLORS)], ' stroke-dasharray="5 3"' if index >= len(COLORS) else ""
        points = [(x(row["size"] / rows[0]["size"]), y(row["processor"])) for row in rows]
        parts.append(f'<polyline points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in points)}" fill="none" '
                     f'stroke="{color}" stroke-width="2"{dashes}/>')  # fmt: skip
        parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{color}"/>' for a, b in points]
        beside = max(beside + APART, points[-1][1])
        parts.append(f'<path d="M{points[-1][0] + 4:.1f} {points[-1][1]:.1f}L{WIDTH - RIGHT + 14} {beside:.1f}" '
                     f'stroke="{color}" stroke-width=".7"/>')  # fmt: skip
        parts.append(f'<text x="{WIDTH - RIGHT + 18}" y="{beside + 4:.1f}" fill="{color}">{name}</text>')
    return "\n".join([*parts, "</svg>\n"])


if __name__ == "__main__":
    OUT.write_text(picture(), encoding="utf-8")
    print(OUT.name)
