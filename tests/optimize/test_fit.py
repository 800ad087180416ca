"""The optimisation loop: it finds what it should, repeats bit for bit, resumes, and says what is wrong."""

import importlib
import math
from dataclasses import replace

import pytest
import torch

import diff3ds as ds
from diff3ds.optimize.adam import BETA1, BETA2, EPSILON
from diff3ds.optimize.checkpoint import read_checkpoint, write_checkpoint
from diff3ds.optimize.checkpoint import start as start_state
from diff3ds.optimize.strokes import Edit

ALL_RATES = ds.Rates(points=0.01, weights=0.01, width=0.01, color=0.01, opacity=0.01)


@pytest.fixture
def views():
    return ds.orbit([0, 90, 200, 290], [10, 40, -10, 20], 2.5, size=48)


@pytest.fixture
def start(generator):
    return ds.Sketch.random(6, generator=generator, radius=0.6, width=0.04)


@pytest.fixture
def objective(start, views):
    """Distance to the start, moved, recoloured and thinned."""
    goal = replace(start, points=start.points + 0.08, color=start.color + 0.5, width=start.width * 0.7)
    target = ds.render(goal, views, antialiasing=ds.Analytic(1.0)).color

    def loss(rendering, cameras, step):
        return (rendering.color - target).square().mean()

    return loss


def last(steps):
    return list(steps)[-1]


def assert_same(a: ds.Sketch, b: ds.Sketch):
    for name, value in a.tensors().items():
        assert torch.equal(value, b.tensors()[name]), name


def test_recovers_what_was_moved(start, views, objective):
    steps = list(
        ds.fit(start, objective, views, ds.FitConfig(steps=150, rates=ALL_RATES, antialiasing=ds.Analytic(1.0)))
    )
    assert [s.index for s in steps] == list(range(150))
    assert steps[-1].loss < 0.02 * steps[0].loss
    moved = (steps[-1].sketch.points - start.points).mean()
    assert abs(moved - 0.08) < 0.02


def test_is_adam(start, views):
    """The points follow torch's own Adam; float64, because rounding grows with the steps."""
    start, config = start.to(torch.float64), ds.FitConfig(steps=12, rates=ds.Rates(points=0.02), final_rate=0.5)
    parameter = start.points.clone().requires_grad_()
    adam = torch.optim.Adam([parameter], lr=0.02, betas=(BETA1, BETA2), eps=EPSILON)
    for index in range(config.steps):
        adam.param_groups[0]["lr"] = 0.02 * 0.5 ** (index / config.steps)
        adam.zero_grad()
        ds.render(replace(start, points=parameter), views).depth.square().mean().backward()
        adam.step()
    found = last(ds.fit(start, lambda r, c, i: r.depth.square().mean(), views, config)).sketch
    assert not torch.equal(found.points, start.points)
    torch.testing.assert_close(found.points, parameter.detach(), rtol=0, atol=1e-10)


def test_only_fields_with_a_rate_change(start, views, objective):
    found = last(ds.fit(start, objective, views, ds.FitConfig(steps=5, rates=ds.Rates(points=0, color=0.1)))).sketch
    assert not torch.equal(found.color, start.color)
    assert_same(replace(found, color=start.color), start)


def test_values_stay_in_range(start, views):
    rates = ds.Rates(points=0.01, weights=1.0, width=0.05, color=1.0, opacity=1.0)
    for sign in (1, -1):
        for step in ds.fit(
            start, lambda r, c, i, s=sign: s * r.color.mean(), views, ds.FitConfig(steps=8, rates=rates)
        ):
            step.sketch.check_values()
            assert 0 <= step.sketch.color.min() <= step.sketch.color.max() <= 1


@pytest.mark.parametrize("antialiasing", ["analytic", "montecarlo"])
def test_repeats_bit_for_bit_on_any_number_of_threads(start, views, objective, antialiasing):
    config = ds.FitConfig(steps=12, rates=ALL_RATES, antialiasing=antialiasing, seed=3)
    before = torch.get_num_threads()
    found = []
    try:
        for count in (1, 2, 3):
            torch.set_num_threads(count)
            found.append(last(ds.fit(start, objective, views, config)).sketch)
            assert torch.get_num_threads() == count
    finally:
        torch.set_num_threads(before)
    assert_same(found[0], found[1])
    assert_same(found[0], found[2])


def test_the_seed_matters_to_monte_carlo(start, views, objective):
    config = ds.FitConfig(steps=2, rates=ALL_RATES, antialiasing="montecarlo")
    found = [last(ds.fit(start, objective, views, replace(config, seed=seed))).sketch for seed in (0, 1)]
    assert not torch.equal(found[0].points, found[1].points)


def drop_and_add(step, steps, sketch, generator):
    """Drops the first stroke and adds a random one, now and then."""
    if step % 4 != 3:
        return None
    return Edit(torch.arange(1, len(sketch)), ds.Sketch.random(1, generator=generator, radius=0.6, width=0.04))


@pytest.mark.parametrize("stop", [5, 9])
def test_resumes_bit_for_bit(start, views, objective, tmp_path, stop):
    config = ds.FitConfig(
        steps=14, rates=ALL_RATES, antialiasing="montecarlo", refinements=[drop_and_add], checkpoint_every=4
    )
    start = replace(start, fixed=torch.arange(len(start)) == len(start) - 1)
    whole = last(ds.fit(start, objective, views, config))
    config = replace(config, checkpoint=tmp_path / "run.safetensors")
    for step in ds.fit(start, objective, views, config):
        if step.index == stop:
            break
    assert read_checkpoint(config.checkpoint).index == stop + 1
    rest = list(ds.fit(start, objective, views, replace(config, resume=True)))
    assert [s.index for s in rest] == list(range(stop + 1, 14))
    assert_same(rest[-1].sketch, whole.sketch)
    assert read_checkpoint(config.checkpoint).sketch.fixed.sum() == 1
    assert len(read_checkpoint(config.checkpoint).losses) == 14
    assert list(tmp_path.iterdir()) == [config.checkpoint]


def test_an_interrupted_step_is_lost_and_no_more(start, views, objective, tmp_path):
    def interrupted(rendering, cameras, step):
        if step == 3:
            raise KeyboardInterrupt
        return objective(rendering, cameras, step)

    config = ds.FitConfig(steps=10, checkpoint=tmp_path / "run.safetensors")
    done = []
    with pytest.raises(KeyboardInterrupt):
        done.extend(ds.fit(start, interrupted, views, config))
    whole = list(ds.fit(start, objective, views, replace(config, checkpoint=None)))
    assert_same(read_checkpoint(config.checkpoint).sketch, whole[2].sketch)


def test_cameras_may_change_with_every_step(start, views):
    seen = []

    def cameras(step, generator):
        return views[[step % len(views)]]

    def loss(rendering, given, step):
        seen.append((len(given), step))
        return rendering.alpha.mean()

    list(ds.fit(start, loss, cameras, ds.FitConfig(steps=5)))
    assert seen == [(1, i) for i in range(5)]


def test_new_strokes_begin_with_full_steps(start, views, objective):
    """Adam's bias correction starts anew for them: the first step of every point is the learning rate."""
    config = ds.FitConfig(
        steps=5, rates=ds.Rates(points=0.01), final_rate=1.0, refinements=[drop_and_add], antialiasing=ds.Analytic(8.0)
    )
    steps = list(ds.fit(start, objective, views, config))
    moved = (steps[4].sketch.points - steps[3].sketch.points)[-1].abs()
    assert moved.max() == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"steps": 0}, "steps must be a positive integer, got 0"),
        ({"checkpoint_every": 2.5}, "checkpoint_every must be a positive integer"),
        ({"rates": ds.Rates(points=-1.0)}, "points must be a finite rate"),
        ({"rates": ds.Rates(points=math.nan)}, "points must be a finite rate"),
        ({"rates": ds.Rates(points=0.0)}, "all learning rates are 0"),
        ({"final_rate": 0.0}, "final_rate must be"),
        ({"resume": True}, "resume needs a checkpoint file"),
        ({"seed": -1}, r"seed must be a whole number from 0 to 2\^63 - 1, got -1"),
        ({"seed": 1 << 64}, "seed must be a whole number"),
        ({"seed": True}, "seed must be a whole number from .*, got True"),
        ({"final_rate": "x"}, "final_rate must be a finite rate, not negative, got x"),
        ({"width_range": 3}, r"width_range must be \(least, greatest\), got 3"),
    ],
)
def test_bad_configurations_say_what_is_wrong(unchecked, change, message):
    with pytest.raises(ValueError, match=message):
        ds.FitConfig(**change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rates": 0.1}, r"rates must be Rates\(points=..., ...\), got 0.1"),
        ({"refinements": 3}, "refinements must be a sequence of functions, got 3"),
        ({"refinements": [3]}, r"refinements must be a sequence of functions, got \[3\]"),
        ({"project": 3}, "project must be a function of sketch, cameras and step, got 3"),
        ({"identity": 3}, "identity must be a mapping from names to what JSON knows, got 3"),
        ({"checkpoint": 3}, "checkpoint must be a path or None, got 3"),
        ({"stateful": 3}, "stateful must be an object with the methods state and restore, got 3"),
    ],
)
def test_configurations_of_another_kind_say_what_is_wrong(unchecked, change, message):
    with pytest.raises(TypeError, match=message):
        ds.FitConfig(**change)


def test_a_checkpoint_may_be_named_by_words(unchecked, start, views, objective, tmp_path):
    config = ds.FitConfig(steps=2, checkpoint=str(tmp_path / "words.safetensors"), resume=True)
    assert len(list(ds.fit(start, objective, views, config))) == 2
    assert not list(ds.fit(start, objective, views, config))


def test_arguments_of_another_kind_say_what_is_wrong(unchecked, start, views, objective):
    with pytest.raises(TypeError, match=r"config must be FitConfig\(...\) or None, got dict"):
        next(ds.fit(start, objective, views, {"steps": 3}))
    with pytest.raises(TypeError, match="objective must be a function of rendering, cameras and step, got int"):
        next(ds.fit(start, 3, views))
    with pytest.raises(TypeError, match="cameras must be Cameras or a function of step and generator, got int"):
        ds.fit(start, objective, 3)
    with pytest.raises(TypeError, match="sketch must be a Sketch, got int"):
        ds.fit(3, objective, views)
    with pytest.raises(TypeError, match="that gives cameras must return Cameras, got int in step 0"):
        next(ds.fit(start, objective, lambda step, generator: 3))


def test_bad_objectives_say_what_is_wrong(unchecked, start, views):
    def fails(objective):
        return lambda: list(ds.fit(start, objective, views, ds.FitConfig(steps=2)))

    with pytest.raises(ValueError, match=r"must return a real scalar tensor, got .* of shape \(4, 48, 48, 3\)"):
        fails(lambda r, c, i: r.color)()
    with pytest.raises(ValueError, match="must return a real scalar tensor, got float"):
        fails(lambda r, c, i: 1.0)()
    with pytest.raises(ValueError, match=r"must return a real scalar tensor, got torch\.complex64"):
        fails(lambda r, c, i: torch.fft.fft(r.color.flatten()).sum())()
    with pytest.raises(ValueError, match="the objective's loss has no gradient: compute it from the rendering"):
        fails(lambda r, c, i: r.color.detach().sum())()
    with pytest.raises(FloatingPointError, match="the loss of step 0 is nan"):
        fails(lambda r, c, i: r.color.sum() * math.nan)()
    with pytest.raises(FloatingPointError, match="the gradient of points in step 0 is not finite"):
        fails(lambda r, c, i: (r.color - r.color.detach()).abs().sum().sqrt())()


def test_losses_of_a_gpu_are_looked_at_now_and_then(start, views, objective, tmp_path, monkeypatch):
    """As if the loss were on a device that nobody waits for: the same run, and a bad step is named later."""
    config = ds.FitConfig(steps=7, rates=ALL_RATES, checkpoint=tmp_path / "now.safetensors")
    expected = list(ds.fit(start, objective, views, config))
    fit = importlib.import_module("diff3ds.optimize.fit")
    monkeypatch.setattr(fit, "_known_at_once", lambda loss: False)
    monkeypatch.setattr(fit, "LOOK_EVERY", 5)
    config = replace(config, checkpoint=tmp_path / "later.safetensors")
    steps = list(ds.fit(start, objective, views, config))
    assert [s.loss for s in steps] == [s.loss for s in expected]
    assert torch.equal(steps[-1].sketch.points, expected[-1].sketch.points)
    kept = [read_checkpoint(tmp_path / f"{name}.safetensors").losses for name in ("now", "later")]
    assert kept[0] == kept[1] == tuple(s.loss for s in expected)
    bad = ds.fit(start, lambda r, c, i: r.color.sum() * (math.nan if i == 2 else 1), views, config)
    assert all(next(bad).sketch.points.isfinite().all() for _ in range(4))
    with pytest.raises(FloatingPointError, match="the loss of step 2, or a gradient in it, is not finite"):
        next(bad)


def test_gradients_are_on_inside(start, views, objective):
    with torch.no_grad():
        (step,) = ds.fit(start, objective, views, ds.FitConfig(steps=1))
    assert not torch.equal(step.sketch.points, start.points)


def test_no_strokes_to_fit(start, views, objective):
    with pytest.raises(ValueError, match="no strokes"):
        ds.fit(start[[]], objective, views)


def test_no_views_to_fit(start, objective):
    with pytest.raises(ValueError, match="the cameras have no views to fit"):
        ds.fit(start, objective, ds.orbit([]))
    some = ds.fit(start, objective, lambda step, generator: ds.orbit([0.0] if step < 1 else [], size=48))
    next(some)
    with pytest.raises(ValueError, match="the cameras of step 1 have no views to fit"):
        next(some)


def test_checkpoints_of_other_runs_and_broken_ones_are_refused(start, views, objective, tmp_path):
    config = ds.FitConfig(steps=3, checkpoint=tmp_path / "run.safetensors", resume=True)
    list(ds.fit(start, objective, views, config))
    with pytest.raises(ValueError, match="the run to resume had seed=0, not 5"):
        ds.fit(start, objective, views, replace(config, seed=5))
    whole = config.checkpoint.read_bytes()
    for broken in (b"", whole[:100], whole[:-8], b"{" * 5000, whole.replace(b"sketch.width", b"sketch.whidt")):
        config.checkpoint.write_bytes(broken)
        with pytest.raises(ValueError, match=r"run\.safetensors.*(checkpoint).*delete it"):
            ds.fit(start, objective, views, config)


def test_an_identity_hides_no_rate(start, views, objective, tmp_path):
    config = ds.FitConfig(
        steps=2,
        rates=ALL_RATES,
        checkpoint=tmp_path / "run.safetensors",
        resume=True,
        identity=dict.fromkeys(("points", "weights", "width", "color", "opacity"), 0.5),
    )
    list(ds.fit(start, objective, views, config))
    for name in ("points", "weights", "width", "color", "opacity"):
        other = replace(config, rates=replace(ALL_RATES, **{name: 0.007}))
        with pytest.raises(ValueError, match=f"the run to resume had rate of {name}=.*, not 0.007"):
            ds.fit(start, objective, views, other)


def test_what_was_read_does_not_hang_on_the_file(start, tmp_path):
    path = tmp_path / "run.safetensors"
    write_checkpoint(path, start_state(start, 0), {})
    state = read_checkpoint(path)
    with path.open("r+b") as file:
        file.write(b"\0" * path.stat().st_size)
    assert_same(state.sketch, start)


class Counter:
    """Learns how often it was asked."""

    def __init__(self):
        self.count = 0

    def __call__(self, rendering, cameras, index):
        self.count += 1
        return (rendering.alpha - 0.1 * self.count).square().mean()

    def state(self):
        return {"count": torch.tensor(self.count)}

    def restore(self, state):
        self.count = int(state["count"])


def test_what_learns_beside_the_sketch_is_resumed(start, views, tmp_path):
    def run(steps, path, resume=False):
        counter = Counter()
        config = ds.FitConfig(steps=8, rates=ALL_RATES, checkpoint=path, resume=resume, stateful=counter)
        for step in ds.fit(start, counter, views, config):
            if step.index + 1 == steps:
                # Work that is lost with the step in which a run is stopped does not count.
                counter.count += 5
                break
        return step.sketch

    whole = run(8, tmp_path / "whole")
    run(3, tmp_path / "part")
    assert_same(run(8, tmp_path / "part", resume=True), whole)


def test_a_run_stopped_in_its_first_step_is_resumed_with_what_learns_beside_it(start, views, tmp_path):
    config = ds.FitConfig(steps=2, checkpoint=tmp_path / "run.safetensors", resume=True, stateful=Counter())

    def interrupt(rendering, cameras, index):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(ds.fit(start, interrupt, views, config))
    counter = Counter()
    steps = list(ds.fit(start, counter, views, replace(config, stateful=counter)))
    assert (len(steps), counter.count) == (2, 2)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (ds.Analytic(1.5), lambda _: ds.Analytic(1.5)),
        (ds.MonteCarlo(9), lambda _: ds.MonteCarlo(9)),
        (ds.MonteCarlo(), "montecarlo"),
    ],
)
def test_antialiasing_as_an_object_a_function_of_the_step_or_a_name(start, views, objective, one, other):
    ways = [ds.FitConfig(steps=3, rates=ALL_RATES, seed=3, antialiasing=how) for how in (one, other)]
    first, second = ([step.loss for step in ds.fit(start, objective, views, config)] for config in ways)
    assert first == second


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("how", "message"),
    [
        (ds.MonteCarlo(generator=torch.Generator()), "a MonteCarlo without a generator in FitConfig"),
        ("msaa", "antialiasing must be "),
    ],
)
def test_antialiasing_is_checked(start, views, objective, how, message):
    """At once, or in the step for which a function gives it."""
    with pytest.raises(ValueError, match=message):
        ds.FitConfig(antialiasing=how)
    with pytest.raises(ValueError, match=message):
        list(ds.fit(start, objective, views, ds.FitConfig(steps=1, antialiasing=lambda _: how)))
