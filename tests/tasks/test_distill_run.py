"""The run of a distillation: its folder, resuming, deletion, the reference view, parameters."""

import json
import math
from functools import partial
from pathlib import Path
from typing import get_args

import pytest
import safetensors.torch
import torch

import diff3ds as ds
from diff3ds._settings import option_hints, with_options
from diff3ds.formats import load_image
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.optimize.checkpoint import read_checkpoint
from diff3ds.optimize.config import FitConfig
from diff3ds.tasks.results import PREVIEW_SIZE, check_output_folder, turntable
from diff3ds.tasks.text_image import distillation
from diff3ds.tasks.text_image.conditioned_prior import BuiltIn, ConditionedPrior
from diff3ds.tasks.text_image.distillation import distill, start_of
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase

SIZE = 16
PLAIN = RunSpec(Phrase("a bar"))
QUICK = with_options(
    PLAIN, steps=12, strokes=6, width=0.1, rate=0.02, radius=0.7, guidance=7.5, sheet_every=0, delete_length=0.0
)


def bar(*ends: float) -> ds.Sketch:
    return ds.Sketch(torch.tensor([[[-ends[0], 0, ends[1]], [ends[0], 0, ends[1]]]]), width=0.1)


@pytest.fixture
def prior() -> ExemplarDenoiser:
    """It knows a low bar and a high one, and is asked for the high one."""
    members = [bar(0.6, -0.4), bar(0.6, 0.4)]

    def draw(cameras: ds.Cameras) -> torch.Tensor:
        return torch.stack([ds.render(member, cameras).color for member in members])

    return ExemplarDenoiser(draw, torch.tensor([False, True]), SIZE)


def run(prior, out, spec=QUICK, report=lambda progress: None, **other):
    return distill(ConditionedPrior("members", prior, **other), spec, out, report)


def start(prior, spec=QUICK) -> ds.Sketch:
    return start_of(ConditionedPrior("members", prior), spec)


def same(one: ds.Sketch, other: ds.Sketch) -> bool:
    pairs = zip(one.tensors().values(), other.tensors().values(), strict=True)
    return all(torch.equal(a, b) for a, b in pairs)


def test_a_run_leaves_its_folder(prior, tmp_path):
    seen = []
    sketch = run(prior, tmp_path, with_options(QUICK, sheet_every=5), report=seen.append)
    names = {path.name for path in tmp_path.iterdir()}
    written = {"sketch.json", "sketch.step", "sketch.svg", "preview.png", "run.json"}
    assert names == written | {distillation.CHECKPOINT, distillation.SHEETS}
    assert same(ds.load(tmp_path / "sketch.json"), sketch)
    info = json.loads((tmp_path / "run.json").read_text())
    assert info["options"]["phrase"] == "a bar"
    assert info["steps_done"] == 12
    assert info["method"] == "reconstruction"
    assert [progress.done for progress in seen] == list(range(1, 13))
    assert seen[0].note == "t 850-850"
    assert seen[-1].note == "t 100-300"
    sheets = sorted(path.name for path in (tmp_path / "progress").iterdir())
    assert sheets == ["step_00005.png", "step_00010.png"]
    # Four renderings above four predictions.
    assert load_image(tmp_path / "progress" / sheets[0]).shape == (2 * SIZE, 4 * SIZE, 3)


def test_a_run_that_was_stopped_ends_like_one_that_was_not(prior, tmp_path):
    whole = run(prior, tmp_path / "whole")

    def stop(progress):
        if progress.done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(prior, tmp_path / "part", report=stop)
    assert json.loads((tmp_path / "part" / "run.json").read_text())["stopped_early"]
    assert not same(ds.load(tmp_path / "part" / "sketch.json"), whole)
    assert same(run(prior, tmp_path / "part", with_options(QUICK, resume=True)), whole)


def test_a_run_whose_disk_filled_up_goes_on_when_there_is_room(prior, tmp_path, monkeypatch):
    """The disk fills up after step 7; what is kept is the checkpoint of step 5."""
    options = with_options(QUICK, sheet_every=0)
    whole = run(prior, tmp_path / "whole", options)
    monkeypatch.setattr(distillation, "FitConfig", partial(FitConfig, checkpoint_every=5))
    write = safetensors.torch.save_file

    def fill(progress):
        if progress.done == 7:
            monkeypatch.setattr("safetensors.torch.save_file", full)

    def full(*arguments):
        raise safetensors.SafetensorError("I/O error: No space left on device (os error 28)")

    with pytest.raises(OSError, match=r"make room.*--resume"):
        run(prior, tmp_path / "part", options, report=fill)
    monkeypatch.setattr("safetensors.torch.save_file", write)
    assert read_checkpoint(tmp_path / "part" / distillation.CHECKPOINT).index == 5
    assert same(run(prior, tmp_path / "part", with_options(options, resume=True)), whole)


@pytest.mark.parametrize(
    "change", [{"radius": 0.5}, {"guidance": 3.0}, {"seed": 1}, {"method": "sds"}, {"t_high": (0.9, 0.3)}]
)
def test_only_the_same_run_is_resumed(prior, tmp_path, change):
    run(prior, tmp_path)
    with pytest.raises(ValueError, match=r"the run to resume had"):
        run(prior, tmp_path, with_options(QUICK, resume=True, **change))
    with pytest.raises(ValueError, match=r"the run to resume had phrase=a bar, not two bars"):
        run(prior, tmp_path, with_options(QUICK, resume=True, phrase="two bars"))


@pytest.mark.slow
def test_the_prior_pulls_the_sketch_towards_what_it_is_asked_for(prior, tmp_path):
    """Measured by the points along its strokes that lie near the bar."""
    options = with_options(QUICK, steps=150, blur=1.0, final_rate=0.1, delete_length=0.1)
    sketch = run(prior, tmp_path, options)

    def share_near(sketch: ds.Sketch) -> float:
        points = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 21)).reshape(1, -1, 3)
        truth = bar(0.6, 0.4)
        return float((ds.bezier.closest_point(truth.points, truth.weights, points).distance < 0.15).float().mean())

    assert share_near(start(prior, options)) < 0.1
    assert share_near(sketch) > 0.8


def test_short_strokes_are_deleted_from_half_way_on(prior, tmp_path):
    counts = []
    options = with_options(QUICK, delete_length=0.5, delete_every=0.1)
    run(prior, tmp_path, options, report=lambda progress: counts.append(progress.strokes))
    assert counts[:5] == [6] * 5
    assert counts[-1] < 6


@pytest.mark.parametrize(
    ("parameters", "moved"),
    [
        (("position",), {"points"}),
        (("color",), {"color"}),
        (("position", "alpha", "color"), {"points", "opacity", "color"}),
        (("width",), {"width"}),
    ],
)
def test_only_the_chosen_parameters_move(prior, tmp_path, parameters, moved):
    options = with_options(QUICK, optimize=parameters, steps=4)
    sketch, begun = run(prior, tmp_path, options), start(prior, options)
    # Sorted by importance; none moves as far as the next one in four steps.
    near = torch.cdist(sketch.points.flatten(1), begun.points.flatten(1)).argmin(1)
    assert sorted(near.tolist()) == list(range(len(begun)))
    found, before = sketch.tensors(), begun[near].tensors()
    assert {name for name in found if not torch.equal(found[name], before[name])} == moved


def test_widths_stay_in_their_range_whatever_the_rate(prior, tmp_path):
    options = with_options(QUICK, optimize=("width",), width_rate=2.0, width_range=(0.05, 0.15))
    widths = run(prior, tmp_path, options).width
    assert float(widths.min()) > 0.0499
    assert float(widths.max()) < 0.1501


@pytest.mark.slow
def test_the_reference_view_is_matched(prior, tmp_path):
    """The prior says nothing here (no guidance towards anything new), the picture says where."""
    cameras = ds.orbit([0.0], 10.0, size=32)
    wanted = bar(0.5, 0.1).transform(torch.tensor([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    picture = ds.render(wanted, cameras).color[0]
    differences = []
    for weight in (0.0, 1e6):
        sketch = run(
            prior, tmp_path / str(weight), with_options(QUICK, steps=40), reference=Reference(picture, cameras, weight)
        )
        differences.append(float((ds.render(sketch, cameras).color[0] - picture).square().mean()))
    assert differences[1] < 0.6 * differences[0]


def test_a_folder_with_a_run_is_kept(prior, tmp_path):
    checkpoint = tmp_path / "checkpoint.safetensors"
    with pytest.raises(ValueError, match="no checkpoint to resume from"):
        check_output_folder(tmp_path, checkpoint, resume=True, overwrite=False)
    check_output_folder(tmp_path / "new", tmp_path / "new" / "checkpoint.safetensors", resume=False, overwrite=False)
    assert not (tmp_path / "new").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file is a file, not a folder for results"):
        check_output_folder(tmp_path / "file" / "run", tmp_path / "file" / "run" / "c", resume=False, overwrite=False)
    run(prior, tmp_path)
    with pytest.raises(ValueError, match="holds a run: give another folder"):
        check_output_folder(tmp_path, checkpoint, resume=False, overwrite=False)
    check_output_folder(tmp_path, checkpoint, resume=False, overwrite=True)
    check_output_folder(tmp_path, checkpoint, resume=True, overwrite=False)


def test_a_full_disk_is_noticed_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 1 << 20}))
    with pytest.raises(OSError, match="1 MiB are free, and a run may need 64"):
        check_output_folder(tmp_path, tmp_path / "checkpoint.safetensors", resume=False, overwrite=False)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"steps": 0}, "steps must be positive"),
        ({"radius": 0.0}, "radius must be positive"),
        ({"optimize": ()}, "optimize must name something"),
        ({"optimize": ("width",), "width": 0.5}, "width must lie in width_range"),
        ({"t_low": (0.9, 0.1)}, "0 < low <= high < 1"),
        ({"delete_from": 2.0}, "delete_from must lie in"),
        ({"sheet_every": -1}, "must not be negative"),
        ({"fov": 180.0}, "fov must lie in"),
        ({"distance": (2.0, 1.8)}, "distance must be"),
        ({"elevation": (0.0, 90.0)}, "elevation in"),
        ({"rescale": 1.5}, "rescale must lie in"),
        ({"clip": 0.0}, "clip must be positive"),
        ({"guidance": float("inf")}, "guidance must be finite"),
        ({"color_rate": -0.1}, "color_rate must not be negative"),
        ({"seed": -1}, "seed must be a whole number"),
    ],
)
def test_options_that_make_no_sense(wrong, message):
    with pytest.raises(ValueError, match=message):
        with_options(QUICK, **wrong)


HINTS = option_hints(RunSpec[Phrase])
NUMBERS = [name for name, hint in HINTS.items() if float in (hint, *get_args(hint))]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_must_be_finite(name, value):
    pair = "tuple" in str(HINTS[name])
    with pytest.raises(ValueError, match=f"^{name} must be finite, got "):
        with_options(QUICK, **{name: (0.5, value) if pair else value})


def test_widths_must_start_in_their_range(prior, tmp_path):
    options = with_options(QUICK, width=None, optimize=("width",), width_range=(0.01, 0.1), steps=1)
    with pytest.raises(ValueError, match=r"strokes start with width 0\.006, outside width_range 0\.01 to 0\.1"):
        run(prior, tmp_path, options)
    run(prior, tmp_path, with_options(options, width=0.05))


def test_methods_have_their_own_weight_of_guidance():
    options = with_options(PLAIN, method="sdi")
    assert options.recipe(4, "paper").guidance == 8.5
    assert with_options(options, guidance=3.0).recipe(4, "paper").guidance == 3.0
    assert PLAIN.recipe(4, "paper").guidance == 50.0
    assert PLAIN.recipe(4, "swift").guidance == 7.5


def test_pictures_of_an_overwritten_run_go(prior, tmp_path):
    run(prior, tmp_path, with_options(QUICK, sheet_every=4))
    run(prior, tmp_path, with_options(QUICK, sheet_every=4, steps=4))
    assert [path.name for path in (tmp_path / "progress").iterdir()] == ["step_00004.png"]


def test_an_option_goes_to_its_group_whatever_that_is():
    changed = with_options(PLAIN, negative="a table", fov=40.0, prior="exemplar")
    assert changed.cameras == with_options(PLAIN.cameras, fov=40.0)
    assert (changed.subject.negative, changed.prior.prior) == ("a table", "exemplar")
    assert changed.score == PLAIN.score
    with pytest.raises(TypeError, match="RunSpec has no option 'colour'"):
        with_options(PLAIN, colour="red")


def test_options_come_before_the_preset():
    assert PLAIN.values("paper").steps == 4000
    assert PLAIN.values("swift").steps == 400
    assert with_options(PLAIN, preset="paper", rate=0.5).values("swift").rate == 0.5
    assert with_options(PLAIN, preset="paper", rate=0.5).values("swift").radius == 1.5


def test_a_batch_must_fill_the_groups_of_the_prior(prior, tmp_path):
    with pytest.raises(ValueError, match="batch must be a multiple of 4, the views of this prior, got 6"):
        run(prior, tmp_path, with_options(QUICK, batch=6))


@pytest.mark.usefixtures("unchecked")
def test_priors_are_told_the_poses_as_they_were_drawn():
    """On the CPU and not copied back, which would wait for the device: another device gets copies to draw with."""
    told = []
    orbits = [ds.orbit([float(step)], size=8) for step in range(2)]
    objective, cameras = distillation.placed(
        lambda rendering, views, step: told.append(views), lambda step, generator: orbits[step], torch.device("meta")
    )
    for step in range(2):
        there = cameras(step, torch.Generator())
        assert there.world_to_camera.device.type == "meta"
        objective(None, there, step)
    assert [id(views) for views in told] == [id(views) for views in orbits]


def test_pictures_of_the_result_show_it_whole():
    """What was bent towards a drawing may leave the unit ball."""
    long = bar(1.4, 0.9)
    cameras = turntable(long)
    seen, _ = cameras.seen(torch.cat([long.points[0].double(), torch.ones(2, 1)], -1) @ cameras.projection.mT)
    assert len(cameras) == 8
    assert (seen > 0).all()
    assert (seen < PREVIEW_SIZE).all()


# The options of a run whose strokes are given.
OWN = with_options(QUICK, strokes=None, width=None, radius=None)


def going_on(tmp_path, *fixed: bool) -> Path:
    """Two bars in a file, of which some are marked as fixed."""
    sketch = ds.Sketch.concatenate([bar(0.6, 0.0), bar(0.5, -0.2)]).to(torch.float64)
    marks = torch.tensor(fixed) if fixed else None
    tensors = {**sketch.tensors(), "width": torch.tensor([0.01, 0.02]).double()}
    ds.save(tmp_path / "edited.json", ds.Sketch(**tensors, fixed=marks))
    return tmp_path / "edited.json"


@pytest.mark.parametrize("fixed", [(True, False), (False, True), ()])
def test_a_run_goes_on_from_a_sketch_whose_fixed_strokes_stay(prior, tmp_path, fixed):
    path = going_on(tmp_path, *fixed)
    given = ds.load(path)
    sketch = run(prior, tmp_path / "out", with_options(OWN, start=path))
    assert len(sketch) == 2
    stays = [torch.equal(a, b) for a, b in zip(sketch.points, given.points, strict=True)]
    assert stays == [*(fixed or (False, False))]
    for name in ("weights", "width", "color", "opacity"):
        assert torch.equal(getattr(sketch, name), getattr(given, name)), name
    assert same(ds.load(tmp_path / "out/sketch.json"), sketch)


def test_a_run_does_not_mind_how_the_strokes_of_a_sketch_look(prior, tmp_path):
    """A prior of black lines sees black lines; what the user painted comes back painted."""
    plain = ds.load(going_on(tmp_path))
    looks = {
        "color": torch.tensor([[0.8, 0.1, 0.1], [1.0, 1.0, 1.0]]).double(),
        "opacity": torch.tensor([0.3, 0.0]).double(),
        "width": torch.tensor([[0.1] * 2, [0.001] * 2]).double(),
    }
    painted = ds.Sketch(**{**plain.tensors(), **looks})
    found = {}
    for name, sketch in (("plain", plain), ("painted", painted)):
        ds.save(tmp_path / f"{name}.json", sketch)
        spec, built_in = with_options(OWN, start=tmp_path / f"{name}.json"), BuiltIn(None, None)
        found[name] = run(prior, tmp_path / name, spec, built_in=built_in)
    assert torch.equal(found["painted"].points, found["plain"].points)
    assert not torch.equal(found["painted"].points, painted.points)
    for name, given in looks.items():
        assert torch.equal(getattr(found["painted"], name), given), name


def test_a_run_from_a_sketch_is_resumed_with_the_same_alone(prior, tmp_path):
    path = going_on(tmp_path, True, False)
    spec = with_options(OWN, start=path)
    whole = run(prior, tmp_path / "whole", spec)

    def stop(progress):
        if progress.done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(prior, tmp_path / "part", spec, report=stop)
    assert same(run(prior, tmp_path / "part", with_options(spec, resume=True)), whole)
    going_on(tmp_path, False, True)
    with pytest.raises(ValueError, match="had start="):
        run(prior, tmp_path / "part", with_options(spec, resume=True))


def test_what_a_run_cannot_go_on_from_is_said(prior, tmp_path):
    path = going_on(tmp_path, True, True)
    with pytest.raises(ValueError, match=r"edited\.json: all strokes are fixed"):
        run(prior, tmp_path / "out", with_options(OWN, start=path))
    path = going_on(tmp_path)
    with pytest.raises(ValueError, match="would take its place: give another folder"):
        run(prior, tmp_path, with_options(OWN, start=path))
    ds.save(path, bar(40.0, 0.4))
    with pytest.raises(ValueError, match="its strokes reach 40 from the origin, and the cameras stand"):
        run(prior, tmp_path / "out", with_options(OWN, start=path))
    ds.save(path, bar(0.001, 0.001))
    with pytest.raises(ValueError, match=r"its strokes reach 0\.00141"):
        run(prior, tmp_path / "out", with_options(OWN, start=path))
    for name, value in (("strokes", 5), ("width", 0.1), ("radius", 1.0)):
        with pytest.raises(ValueError, match=f"leave --{name} out"):
            with_options(PLAIN, start=path, **{name: value})
    assert not (tmp_path / "out").exists()
