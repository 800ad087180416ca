"""The paper's comparisons, for whoever has the weights: one command, one table.

    python benchmarks/paper.py TABLE -o OUT --clip openai/clip-vit-base-patch16 openai/clip-vit-base-patch32 [--dry]

TABLE: text (Stable Diffusion against MVDream), image (Zero123 against Stable-Zero123), guidance, schedule, radius,
strokes (these four of MVDream; --options "--prior NAME" takes another). Every phrase of --prompts (or picture of
--pictures) is run by every method through `diff3ds text` (`image`), into OUT/METHOD/NAME; what is finished is not run
again, and what was broken off goes on. Then `diff3ds eval` scores them. --dry prints the commands instead. A run takes
an hour of a small GPU, so --first 3 takes three subjects only.
"""

import argparse
import re
import shlex
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import torch
from report import say, show

from diff3ds.cli import main as diff3ds
from diff3ds.tasks.evaluate.evaluate import OWN, evaluate, prompt_file, read_prompts
from diff3ds.tasks.evaluate.evaluate_options import EvaluateOptions, JudgeOptions
from diff3ds.tasks.evaluate.judges import load_judges, require_networks
from diff3ds.tasks.evaluate.score_table import Summary, columns_of, summaries
from diff3ds.tasks.text_image.distillation import CHECKPOINT

# Options of every method of a table; those of the paper, unless another one is compared. The prior is always named:
# without a GPU another one would be taken, with another preset. DreamFusion draws timesteps from .02 to .98 all the
# time.
PRIOR = "--prior mvdream"
TABLES: dict[str, dict[str, str]] = {
    "text": {name: f"--prior {name}" for name in ("stable-diffusion", "mvdream")},
    "image": {name: f"--prior {name}" for name in ("zero123", "stable-zero123")},
    "guidance": {f"guidance-{g}": f"{PRIOR} --guidance {g}" for g in (7.5, 25, 50, 100)},
    "schedule": {"annealed": PRIOR, "dreamfusion": f"{PRIOR} --t-high 0.98 0.98 --t-low 0.02 0.02"},
    "radius": {f"radius-{r}": f"{PRIOR} --radius {r}" for r in (0.5, 1.0, 1.5, 2.0)},
    "strokes": {f"strokes-{n}": f"{PRIOR} --strokes {n}" for n in (14, 28, 56, 112)},
}
PICTURES = (".png", ".jpg", ".jpeg", ".webp")


def commands(options: argparse.Namespace) -> Iterator[list[str]]:
    """Arguments of `diff3ds`, one list for each run that is not finished."""
    kind, subjects = "text", {_name(phrase): phrase for phrase in _phrases(options)}
    if options.table == "image":
        kind, subjects = "image", {path.stem: str(path) for path in _pictures(options)}
    for method, chosen in TABLES[options.table].items():
        for name, subject in list(subjects.items())[: options.first]:
            out = options.out / method / name
            if not (out / "run.json").exists():
                resume = ["--resume"] if (out / CHECKPOINT).exists() else []
                yield [kind, subject, "-o", str(out), *chosen.split(), *shlex.split(options.options), *resume]


def _phrases(options: argparse.Namespace) -> list[str]:
    return read_prompts(prompt_file(options.prompts)) if options.table != "image" else []


def _pictures(options: argparse.Namespace) -> list[Path]:
    if options.pictures is None:
        raise SystemExit("the table needs pictures: give --pictures FOLDER")
    return sorted(path for path in options.pictures.iterdir() if path.suffix.lower() in PICTURES)


def _name(phrase: str) -> str:
    return re.sub(r"\W+", "-", phrase.lower()).strip("-")


def parser() -> argparse.ArgumentParser:
    """Options; the networks by their names in `JudgeOptions`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--prompts", default=OWN, help="file with a phrase on each line; default 35 of our own")
    parser.add_argument("--pictures", type=Path, help="folder with a picture of each object")
    parser.add_argument("--first", type=int, help="so many subjects only")
    parser.add_argument("--options", default="", help="more options of diff3ds for all, such as '--steps 400'")
    parser.add_argument("--dry", action="store_true", help="print the commands")
    for name in ("clip", "blip", "alexnet", "lpips-alex", "vgg16", "lpips-vgg"):
        parser.add_argument(f"--{name}", nargs="+" if name == "clip" else None, help="as of diff3ds eval")
    return parser


def main() -> None:
    """Runs what is missing, then scores everything."""
    options = parser().parse_args()
    if options.dry:
        for arguments in commands(options):
            say(shlex.join(["diff3ds", *arguments]))
        return
    # Missing weights of the judges are an error before the first run, not after the last.
    given = {f.name: getattr(options, f.name, None) for f in fields(JudgeOptions)}
    try:
        judges = JudgeOptions(**{n: tuple(v) if isinstance(v, list) else v for n, v in given.items() if v is not None})
        require_networks(judges)
        load_judges(judges, torch.device("cpu"))
    except (ValueError, OSError, ImportError) as error:
        raise SystemExit(str(error)) from None
    for arguments in commands(options):
        say(shlex.join(["diff3ds", *arguments]))
        diff3ds(arguments)
    rows = evaluate(options.out, options.out, judges, EvaluateOptions())
    names = columns_of(rows)
    table = [[method, *(_cell(some.get(name)) for name in names)] for method, some in summaries(rows).items()]
    show(f"{options.table}: {options.out / 'evaluation.md'}", ["method", *names], table)


def _cell(summary: Summary | None) -> str:
    return "" if summary is None else f"{summary.mean:.4f}"


if __name__ == "__main__":
    main()
