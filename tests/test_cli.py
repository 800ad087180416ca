"""The command line as a whole: every command says what it needs, and fails with a sentence."""

import io
import json
import re
import sys
from datetime import timedelta

import pytest
import torch
from rich.console import Console

import diff3ds as ds
from diff3ds import cli
from diff3ds.cli import FAULT, STOPPED, main
from diff3ds.command_line.console import _rate, progress_on
from diff3ds.command_line.read_options import as_typed
from diff3ds.tasks.progress import Progress
from diff3ds.tasks.text_image import text
from diff3ds.tasks.views import run_views as views
from diff3ds.weights import fetch

COMMANDS = [
    "text",
    "image",
    "views",
    "mesh",
    "points",
    "render",
    "export",
    "apply",
    "view",
    "eval",
    "prior",
    "fetch",
    "doctor",
]


def ends(arguments: list[str], capsys) -> tuple[int, str, str]:
    """Exit code, output and messages on one line."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    said = capsys.readouterr()
    return ended.value.code, said.out, " ".join(said.err.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    code, out, _ = ends([command, "--help"], capsys)
    assert code == 0
    assert f"usage: diff3ds {command}" in out


def test_help_tells_of_what_is_already_given(capsys):
    assert re.search(r"usage: diff3ds prior .*\{train\}", ends(["prior", "train", "--help"], capsys)[1])


def test_help_says_what_happens_without_an_option(capsys):
    """--no-redraw (default: True) would say the contrary."""
    said = " ".join(ends(["text", "--help"], capsys)[1].split())
    assert "(default: it is drawn again)" in said
    assert "default: True" not in said


def test_the_recipe_has_options_of_its_own(capsys):
    assert "--clip-rn101" in ends(["views", "--recipe", "3doodle", "--help"], capsys)[1]
    assert "--clip-rn101" not in ends(["views", "--help"], capsys)[1]


def test_doctor_as_json_is_json(capsys):
    main(["doctor", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"base", "packages", "devices", "weights", "built_in", "priors", "judges"}
    assert {prior["name"] for prior in found["priors"]} >= {"mvdream", "stable-diffusion", "zero123"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fetch", "dall-e"], "prior must be one of stable-diffusion"),
        (["eval", "."], "no run of a phrase or a picture or posed pictures"),
        (["views", "nowhere"], "nowhere"),
        (["views"], "give either a transforms.json"),
        (["text", "", "--prior", "exemplar"], "the phrase is empty"),
        (["text", "a chair", "--steps", "0"], "diff3ds: --steps must be positive, got 0"),
        (["text", "a chair", "--color-rate", "-1"], "diff3ds: --color-rate must not be negative"),
        (["text", "a chair", "--delete-length", "nan"], "diff3ds: --delete-length must be finite, got nan"),
        (["text", "a chair", "--radius", "inf"], "diff3ds: --radius must be finite, got inf"),
        (["text", "a chair", "--distance", "1.8", "inf"], "diff3ds: --distance must be finite, got 1.8 inf"),
        (["image", "x.png", "--view-elevation", "nan"], "diff3ds: --view-elevation must be finite, got nan"),
        (["image", "x.png", "--view-elevation", "90"], "diff3ds: --view-elevation must lie in (-90, 90)"),
        (["image", "x.png", "--reference-loss", "inf"], "diff3ds: --reference-loss must be finite, got inf"),
        (["text", "a chair", "--delete-from", "2"], "--delete-from must lie in [0, 1] and --delete-every in (0, 1]"),
        (
            ["text", "a chair", "--optimize", "width", "--width", "0.5"],
            "--width must lie in --width-range (0.001, 0.1)",
        ),
        (["text", "a chair", "--t-low", "0.9", "0.1"], "--t-low, --t-high, --anneal-share: timesteps must be drawn"),
        (["image", "x.png", "--reference-loss", "-1"], "--reference-loss must not be negative, got -1.0"),
        (["eval", "runs", "--elevation", "nan"], "diff3ds: --elevation must be finite, got nan"),
        (["views", "--recipe", "3doodle", "x", "--width", "inf"], "diff3ds: --width must be finite, got inf"),
        (["views", "--recipe", "3doodle", "x", "--clip-weight", "-1"], "--clip-weight and --vgg-weight must not be"),
        (["text", "a chair", "--steps", "many"], "diff3ds: --steps must be a whole number, got 'many'"),
        (["text", "a chair", "--seed=1.5"], "diff3ds: --seed must be a whole number, got '1.5'"),
        (["text", "a chair", "--rate", "slow"], "diff3ds: --rate must be a number, got 'slow'"),
        (["text", "a chair", "--fov", "wide"], "diff3ds: --fov must be a number, got 'wide'"),
        (["text", "a chair", "--distance", "1.8", "x"], "diff3ds: --distance must be two numbers, got '1.8', 'x'"),
        (["text", "a chair", "--stepz", "3"], "Unrecognized options: --stepz"),
        (["text", "a chair", "--stepz", "3"], "run diff3ds text --help"),
        (["views", "--recipe", "3doodle", "--demo"], "options of its own: diff3ds views --recipe 3doodle --help"),
        (["views", "--recipe", "3doodle"], "diff3ds: give a transforms.json of coloured pictures, or a folder with"),
        (["text", "a", "chair"], 'A phrase of several words stands in quotes: diff3ds text "a chair with armrests"'),
        (["text", "a chair", "--size", "70000"], "diff3ds: --size must be a whole number up to 65536, got 70000"),
        (["text", "a chair", "--seed", str(10**25)], "diff3ds: --seed must be a whole number from 0 to 2^63 - 1"),
        (["views", "--demo", "--seed", "-3"], "diff3ds: --seed must be a whole number from 0 to 2^63 - 1, got -3"),
    ],
)
def test_faults_are_sentences(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, said = ends(arguments, capsys)
    assert code in (FAULT, 2)
    assert message in said
    assert "Traceback" not in said
    assert "tyro" not in said
    assert not list(tmp_path.iterdir())


def test_a_phrase_in_quotes_needs_no_hint(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, _, said = ends(["text", "a chair", "--size", "64", "64"], capsys)
    assert "Unrecognized options: 64" in said
    assert "stands in quotes" not in said


def test_faults_in_colours_are_told_alike(capsys, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert "--seed must be a whole number, got '1.5'" in ends(["text", "a chair", "--seed", "1.5"], capsys)[2]
    said = ends(["text", "a", "chair"], capsys)[2]
    assert "\x1b" in said
    assert "stands in quotes" in said


@pytest.mark.parametrize(("given", "size"), [(64, 64), (1024, 256)])
def test_pictures_of_the_demo_are_reduced(given, size, tmp_path, monkeypatch):
    class Seen(Exception):  # noqa: N818
        pass

    def see(pictures, *arguments, say):
        assert pictures.cameras.size == (size, size)
        raise Seen

    monkeypatch.setattr(views, "fit_edges", see)
    with pytest.raises(Seen):
        main(["views", "--demo", "--size", str(given), "-o", str(tmp_path), "--quiet"])


def test_only_options_are_written_as_options():
    """Steps of a run, a width that something has, positional arguments and files are none."""
    message = (
        "/a/color_rate.json, color_rate: the run to resume had seed=0, not 1, and steps with width 2; x.color_rate"
    )
    expected = message.replace(", color_rate", ", --color-rate").replace("seed", "--seed")
    assert as_typed(message, cli.Text) == expected
    assert as_typed("prior must be one of mvdream", cli.Fetch) == "prior must be one of mvdream"
    assert as_typed("prior must be one of mvdream", cli.Text) == "--prior must be one of mvdream"
    assert as_typed("steps must be positive", cli.Doctor) == "steps must be positive"


def test_a_gpu_without_room_is_a_sentence(capsys, tmp_path, monkeypatch):
    def full(*arguments):
        raise torch.cuda.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB. GPU 0 has ...")

    monkeypatch.setattr(text, "run_text", full)
    code, _, said = ends(["text", "a chair", "-o", str(tmp_path)], capsys)
    assert code == FAULT
    assert "CUDA out of memory. Try --precision float16" in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    "error", [MemoryError("std::bad_alloc"), RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried ...")]
)
def test_a_machine_without_room_is_a_sentence(error, capsys, tmp_path, monkeypatch):
    def full(*arguments):
        raise error

    monkeypatch.setattr(text, "run_text", full)
    code, _, said = ends(["text", "a chair", "-o", str(tmp_path)], capsys)
    assert code == FAULT
    assert said == "diff3ds: there is not enough memory. Try fewer strokes, a smaller --batch or --size"


def test_the_version_is_said(capsys):
    cli.main(["--version"])
    assert capsys.readouterr().out == f"diff3ds {ds.__version__}\n"
    assert '"diff3ds --version"' in ends(["--help"], capsys)[1]


def test_a_folder_may_have_any_name(capsys, monkeypatch):
    """Square brackets are no markup."""
    monkeypatch.setattr(text, "run_text", lambda *arguments: ds.Sketch(torch.rand(1, 4, 3)))
    cli.main(["text", "a chair", "-o", "mug [v2] [/v3]"])
    assert "1 stroke: mug [v2] [/v3]/sketch.json" in capsys.readouterr().err


def test_a_download_that_was_stopped_goes_on_by_the_same_command(capsys, monkeypatch):
    def stop(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(fetch, "fetch", stop)
    code, _, said = ends(["fetch", "mvdream", "--quiet"], capsys)
    assert code == STOPPED
    assert said == "stopped; the same command goes on"


@pytest.mark.parametrize(
    ("speed", "shown"), [(42.4, "42 steps/s"), (1.23, "1.2 steps/s"), (0.55, "1.8 s a step"), (0.02, "50.0 s a step")]
)
def test_the_rate_of_slow_steps_is_not_zero(speed, shown):
    assert _rate(speed) == shown


@pytest.mark.parametrize(("seconds", "shown"), [(0.5, "2.0 steps/s"), (10.0, "10.0 s a step"), (60.0, "60.0 s a step")])
def test_rate_and_time_left_are_there_after_two_steps(seconds, shown):
    """However slow they are; of a run that goes on from step 1000, too, whose first step counts from there."""
    screen, now = io.StringIO(), [0.0]
    console = Console(file=screen, force_terminal=True, width=140, get_time=lambda: now[0])
    with progress_on(console) as report:
        for step in (1001, 1002):
            now[0] += seconds
            report(Progress("distill", step, 1062, 0.5, 56))
    last = re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", screen.getvalue()).split("distill")[-1]
    assert f"1002/1062  {shown}" in last
    assert f" {timedelta(seconds=60 * seconds)} " in last


def test_a_bar_is_drawn_no_more_than_ten_times_a_second():
    screen, now = io.StringIO(), [0.0]
    console = Console(file=screen, force_terminal=True, width=140, get_time=lambda: now[0])
    with progress_on(console) as report:
        for step in range(1, 40):
            report(Progress("fit", step, 62, None, 0))
            now[0] += 0.03
    # The first, and every fourth after it.
    assert "37/62" in screen.getvalue()
    assert not any(f"{step}/62" in screen.getvalue() for step in (36, 38, 39))
