"""`diff3ds text` and `image` with the small prior: end to end with a tiny network, and what is refused."""

import hashlib
import json
import math
import tomllib
from pathlib import Path

import pytest
import torch
from nearness import f_score
from safetensors import safe_open
from safetensors.torch import save_file

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.cli import main
from diff3ds.formats import save_png
from diff3ds.guidance.built_in.small import SCHEDULE, Vocabulary, read_network, write_network
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.built_in.small_shape import Shape
from diff3ds.library import member
from diff3ds.library.phrase import Request
from diff3ds.tasks.small_prior import small_prior
from diff3ds.tasks.small_prior.prior_data import BuiltIn, Examples, words
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image import distillation
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

FEW = ["--steps", "3", "--strokes", "6", "--sheet-every", "0"]


@pytest.fixture
def weights(tmp_path):
    torch.manual_seed(0)
    network = SmallNetwork(Shape(len(words()), patch=16, width=16, depth=1, heads=2))
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    path = tmp_path / "small.safetensors"
    write_network(path, network, Vocabulary(words(), 0.18, 0.37), {})
    return path


@pytest.mark.slow
def test_a_phrase_becomes_strokes_of_its_colour_also_when_it_stops_half_way(weights, tmp_path, monkeypatch, capsys):
    def command(out, *more):
        given = ["--weights", str(weights), "-o", str(out), "--steps", "6", "--strokes", "5", "--sheet-every", "3"]
        main(["text", "a tall red lamp", "--prior", "small", "--quiet", *given, *more])

    whole, part = tmp_path / "whole", tmp_path / "part"
    command(whole)
    sketch = ds.load(whole / "sketch.json")
    assert torch.allclose(sketch.color, torch.tensor([0.8, 0.1, 0.1]).expand(len(sketch), 3))
    run = json.loads((whole / "run.json").read_text())
    assert run["options"]["prior"] == "small"
    assert run["network"]["weights_sha256"] == hashlib.sha256(weights.read_bytes()).hexdigest()
    assert run["network"]["device"] == "cpu"

    def interrupt(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(distillation, "contact_sheet", interrupt)
        with pytest.raises(SystemExit):
            command(part)
    assert json.loads((part / "run.json").read_text())["steps_done"] == 3
    other = weights.read_bytes()
    write_network(weights, *read_network(weights), {"steps": 7})
    with pytest.raises(SystemExit):
        command(part, "--resume")
    assert "the run to resume had weights_sha256" in capsys.readouterr().err
    weights.write_bytes(other)
    command(part, "--resume")
    assert (whole / "sketch.json").read_bytes() == (part / "sketch.json").read_bytes()


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_a_picture_is_the_networks_reference(weights, tmp_path, capsys):
    mug = member("mug", torch.Generator().manual_seed(5)).sketch
    picture = tmp_path / "mug.png"
    save_png(picture, ds.render(mug, ds.orbit(40, 20, 1.9, fov=60, size=256)).color[0])
    main(["image", str(picture), "--prior", "small", "--weights", str(weights), "-o", str(tmp_path / "out"), *FEW])
    assert "recognised: a mug" in capsys.readouterr().err
    assert (tmp_path / "out" / "sketch.json").exists()


def test_the_request_reaches_the_network(weights):
    plain, arms = (trained(str(weights)).asked(Request("chair", kind)) for kind in ((), ("armrests",)))
    cameras = ds.orbit([0.0, 90, 180, 270], 15, 1.9, size=64)
    noisy = torch.randn(4, 1, 64, 64, generator=torch.Generator().manual_seed(0))
    asked = (noisy, torch.full((4,), 500), cameras, ("conditional", "unconditional"))
    one, other = plain.predict(*asked), arms.predict(*asked)
    assert torch.equal(one[1], other[1])
    assert not torch.equal(one[0], other[0])


def test_a_network_keeps_the_list_of_kinds_that_it_was_trained_on(tmp_path, capsys):
    """Fewer than the library has, and in another order."""
    kinds = ("mug", "chair")
    path, out = tmp_path / "two.safetensors", tmp_path / "out"
    network = SmallNetwork(Shape(len(words(kinds)), patch=16, width=16, depth=1, heads=2))
    write_network(path, network, Vocabulary(words(kinds), 0.18, 0.37), {})
    two = trained(str(path))
    assert two.is_of_the_library
    assert two.kinds == kinds
    assert two.understood("an armchair") == Request("chair", ("armrests",))
    said = two.told(Request("chair", ("armrests",)))
    assert [two.vocabulary.words[int(i)] for i in said.nonzero()] == ["chair", "chair: armrests"]
    for phrase in ("a lamp", "a chair with a lamp on it"):
        with pytest.raises(SystemExit):
            main(["text", phrase, "--prior", "small", "--weights", str(path), "-o", str(out), *FEW])
        message = " ".join(capsys.readouterr().err.split())
        assert "not trained on 'lamp': leave --prior small out" in message
        assert "prior train -o prior" in message
    assert not out.exists()


def test_the_network_of_the_package_knows_kinds_of_the_library(shipped):
    """New kinds of the library, and new ways to say something, change none of its words."""
    assert shipped.is_of_the_library
    assert len(shipped.kinds) == 40
    assert shipped.vocabulary.words == words(shipped.kinds)


@pytest.mark.usefixtures("few_members")
def test_what_it_cannot_draw_is_refused(weights, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    for phrase, wrong, message in (
        ("a zebra", [], "does not know"),
        ("a mug", ["--method", "vsd"], "vsd trains a network"),
        ("a mug", ["--negative", "a chair"], "built-in priors have none"),
        ("a mug", ["--precision", "float16"], "--precision is for networks of diffusers"),
        ("a mug", ["--variant", "fp16"], "--variant is for networks of diffusers"),
        ("a mug", ["--allow-pickle"], "--allow-pickle is for networks of diffusers"),
    ):
        with pytest.raises(SystemExit):
            main(["text", phrase, "--prior", "small", "--weights", str(weights), "-o", str(out), *wrong])
        assert message in " ".join(capsys.readouterr().err.split())
    monkeypatch.setattr(small_prior, "BESIDE", tmp_path / "none")
    monkeypatch.setattr(small_prior, "CARRIER", "no_such_package")
    with pytest.raises(SystemExit):
        main(["text", "a mug", "--prior", "small", "-o", str(out)])
    message = " ".join(capsys.readouterr().err.split())
    assert 'not installed: pip install "diff3ds[networks]", or train one: diff3ds prior train' in message
    picture = tmp_path / "mug.png"
    mug = member("mug", torch.Generator().manual_seed(5)).sketch
    save_png(picture, ds.render(mug, ds.orbit(40, 20, 1.9, fov=60, size=256)).color[0])
    with pytest.raises(SystemExit):
        main(["image", str(picture), "--prior", "small", "-o", str(out)])
    assert "diff3ds prior train" in capsys.readouterr().err
    assert not out.exists()


def test_the_network_is_found_in_the_package_that_carries_it_where_there_is_no_checkout(weights, tmp_path, monkeypatch):
    root = Path(__file__).parents[2]
    build = tomllib.loads((root / "networks/pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    ((source, target),) = ((root / "networks" / a, b) for a, b in build["force-include"].items() if "small" in a)
    assert source.resolve() == small_prior.BESIDE
    assert target == f"{small_prior.CARRIER}/{small_prior.BESIDE.name}"
    installed = tmp_path / "site-packages" / target
    installed.parent.mkdir(parents=True)
    weights.rename(installed)
    monkeypatch.syspath_prepend(installed.parents[1])
    assert small_prior.own_network() == small_prior.BESIDE
    monkeypatch.setattr(small_prior, "BESIDE", tmp_path / small_prior.BESIDE.name)
    assert trained().source == str(installed)


def test_files_that_say_absurd_things_are_refused(weights, tmp_path):
    with safe_open(weights, "pt") as file:
        meta = json.loads(file.metadata()["diff3ds"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    for part, name, value in (
        ("shape", "words", math.inf),
        ("shape", "width", 10**400),
        ("vocabulary", "mean", 10**400),
        ("vocabulary", "spread", 0),
        ("vocabulary", "words", 3),
    ):
        wrong = meta | {part: meta[part] | {name: value}}
        save_file(tensors, tmp_path / "wrong.safetensors", {"diff3ds": json.dumps(wrong)})
        with pytest.raises(ValueError, match=r"wrong\.safetensors: not a network of the small prior"):
            read_network(tmp_path / "wrong.safetensors")


@pytest.fixture(scope="module")
def shipped():
    return trained()


def test_the_network_of_the_package_heeds_words_views_and_the_picture(shipped):
    """On members that it was not trained on, at much noise: right words help, wrong ones harm, and so on."""
    known = BuiltIn(shipped.kinds)
    examples = [Examples(1_000_000, 8, known)[i] for i in range(8)]
    batch = {name: torch.stack([example[name] for example in examples]) for name in examples[0]}
    network, vocabulary = shipped.network, shipped.vocabulary
    clean = (batch["views"] - vocabulary.mean) / vocabulary.spread
    noise = torch.randn(clean.shape, generator=torch.Generator().manual_seed(0))
    kept = SCHEDULE.alpha_bars[850]
    noisy, time = kept.sqrt() * clean + (1 - kept).sqrt() * noise, torch.full((8,), 0.85)

    @torch.no_grad()
    def error(words=batch["words"], cameras=batch["cameras"], *reference):
        v = network(noisy, time, cameras, words, *reference)
        return float((kept.sqrt() * noisy - (1 - kept).sqrt() * v - clean).square().mean())

    told = error()
    assert told < 0.4
    assert told < 0.7 * error(torch.zeros_like(batch["words"]))
    assert told < 0.5 * error(batch["words"].roll(1, 0))
    turned = batch["cameras"] + torch.tensor([math.pi / 4, 0.0, 0.0])
    assert told < 0.8 * error(cameras=turned)


@pytest.mark.slow
def test_the_network_of_the_package_makes_a_sketch(tmp_path):
    spec = with_options(RunSpec(Phrase("a bow")), prior="small", steps=150, strokes=60, sheet_every=0)
    sketch = run_text(spec, tmp_path / "run")
    pool = [member("bow", torch.Generator().manual_seed(seed)).sketch for seed in range(12)]
    assert max(f_score(sketch, known) for known in pool) > 0.8
    others = [member(name, torch.Generator().manual_seed(0)).sketch for name in ("chair", "mug", "car", "tree")]
    assert max(f_score(sketch, other) for other in others) < 0.6
