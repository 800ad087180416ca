"""`diff3ds text` and `diff3ds image` end to end, through the command line, on tiny random checkpoints."""

import importlib
import json
import sys
from pathlib import Path

import pytest
import torch
from needs import needs
from PIL import Image
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

import diff3ds as ds
from diff3ds.cli import FAULT, STOPPED, main
from diff3ds.guidance.recipe import USUAL, Work
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.tasks.text_image import distillation, priors
from diff3ds.tasks.text_image.prior_options import PriorOptions
from diff3ds.tasks.text_image.priors import load_for_phrase
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.weight_options import Source

sys.path.insert(0, str(Path(__file__).parents[1] / "guidance"))
from tiny import save_mvdream, save_stable_diffusion
from tiny_zero123 import save_zero123

pytestmark = needs("diffusers", "transformers", "ftfy")

STEPS = 4
QUICK = ["--steps", str(STEPS), "--strokes", "5", "--width", "0.05", "--radius", "0.7", "--sheet-every", "2", "--quiet"]


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("checkpoints")
    return {
        "stable-diffusion": save_stable_diffusion(folder / "sd"),
        "stable-diffusion-768": save_stable_diffusion(folder / "sdv", "v_prediction"),
        "mvdream": save_mvdream(folder / "mv", "ashawkey"),
        "zero123": save_zero123(folder / "z"),
        "stable-zero123": save_zero123(folder / "sz", "cc_projection", "projection"),
    }


@pytest.fixture(scope="module")
def drawing(tmp_path_factory) -> Path:
    """A dark cross on white."""
    pixels = torch.full((90, 120, 3), 255, dtype=torch.uint8)
    pixels[20:70, 55:65] = 30
    pixels[40:50, 30:90] = 30
    path = tmp_path_factory.mktemp("drawing") / "cross.png"
    Image.fromarray(pixels.numpy()).save(path)
    return path


def command(prior: str, checkpoints, drawing, out: Path, *more: str) -> list[str]:
    picture = prior.endswith("zero123")
    subject = ["image", str(drawing)] if picture else ["text", "a chair"]
    return [*subject, "--prior", prior, "--weights", str(checkpoints[prior]), "-o", str(out), *QUICK, *more]


def fails(arguments: list[str], capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == FAULT
    return " ".join(capsys.readouterr().err.split())


def same(one: Path, other: Path) -> bool:
    return (one / "sketch.json").read_bytes() == (other / "sketch.json").read_bytes()


PRIORS = ["stable-diffusion", "stable-diffusion-768", "mvdream", "zero123", "stable-zero123"]


@pytest.mark.parametrize(
    ("prior", "method"),
    [
        pytest.param("mvdream", None, marks=pytest.mark.slow),
        *(pytest.param(prior, None, marks=pytest.mark.slow) for prior in PRIORS if prior != "mvdream"),
        *(pytest.param(prior, "vsd", marks=pytest.mark.slow) for prior in ("mvdream", "zero123")),
    ],
)
def test_a_run_resumed_half_way_ends_as_one_without_a_break(
    prior, method, checkpoints, drawing, tmp_path, monkeypatch, capsys
):
    whole, part = tmp_path / "whole", tmp_path / "part"
    more = ["--method", method] if method else []
    main(command(prior, checkpoints, drawing, whole, *more))
    info = json.loads((whole / "run.json").read_text())
    assert info["options"]["prior"] == prior
    assert info["steps_done"] == STEPS
    assert info["guidance"] == (7.5 if prior.endswith("zero123") or method == "vsd" else 50.0)
    assert info["method"] == (method or ("reconstruction" if prior == "mvdream" else "sds"))
    assert len(list((whole / "progress").iterdir())) == 2
    names = {"sketch.json", "sketch.step", "sketch.svg", "preview.png", "run.json", "checkpoint.safetensors"}
    assert names <= {path.name for path in whole.iterdir()}
    start = ds.Sketch.random(5, radius=0.7, width=0.05, generator=torch.Generator().manual_seed(0))
    assert not torch.equal(ds.load(whole / "sketch.json").points, start.points)

    def interrupt(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        # Comes after step 2.
        patch.setattr(distillation, "contact_sheet", interrupt)
        with pytest.raises(SystemExit) as ended:
            main(command(prior, checkpoints, drawing, part, *more))
    assert ended.value.code == STOPPED
    assert "what was reached is written, --resume goes on" in capsys.readouterr().err
    assert json.loads((part / "run.json").read_text())["steps_done"] == 2
    assert not same(whole, part)
    main(command(prior, checkpoints, drawing, part, "--resume", *more))
    assert same(whole, part)


def test_before_the_first_step_there_is_nothing_to_resume(checkpoints, tmp_path, monkeypatch, capsys):
    def interrupt(*arguments, **others):
        raise KeyboardInterrupt

    monkeypatch.setattr(priors, "load_mvdream", interrupt)
    with pytest.raises(SystemExit) as ended:
        main(command("mvdream", checkpoints, None, tmp_path / "out"))
    assert ended.value.code == STOPPED
    assert capsys.readouterr().err == "stopped before there was anything new to keep\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("prior", "found"),
    [pytest.param("mvdream", "mvdream", marks=pytest.mark.slow), ("stable-diffusion", "stable-diffusion")],
)
def test_weights_alone_say_which_prior_they_are(prior, found, checkpoints, tmp_path):
    main(["text", "a chair", "--prior", str(checkpoints[prior]), "-o", str(tmp_path / "named"), *QUICK])
    assert json.loads((tmp_path / "named" / "run.json").read_text())["options"]["prior"] == found
    main(command(prior, checkpoints, None, tmp_path / "both"))
    assert same(tmp_path / "named", tmp_path / "both")


def test_other_weights_of_the_same_kind_are_another_run(checkpoints, tmp_path, capsys):
    arguments = ["text", "a chair", "-o", str(tmp_path / "run"), *QUICK, "--steps", "1"]
    main([*arguments, "--prior", str(checkpoints["stable-diffusion"])])
    other = save_stable_diffusion(tmp_path / "other")
    said = fails([*arguments, "--prior", str(other), "--resume"], capsys)
    assert f"the run to resume had --weights={checkpoints['stable-diffusion']}, not {other}" in said


@pytest.mark.slow
def test_a_name_is_a_prior_though_there_is_a_folder_of_that_name(checkpoints, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mvdream").mkdir()
    (tmp_path / "mvdream" / "run.json").write_text("{}")
    main([*command("mvdream", checkpoints, None, tmp_path / "out", "--steps", "1")])
    said = fails(["text", "a chair", "--prior", "mvdream", "-o", "mvdream", "--overwrite"], capsys)
    assert "no weights for mvdream" in said


def test_weights_need_a_prior():
    """Without one, the built-in prior would be taken, and they would be ignored."""
    with pytest.raises(ValueError, match=r"or --prior owner/name"):
        PriorOptions(weights="owner/name")
    with pytest.raises(ValueError, match="exemplar is built in and takes no weights"):
        PriorOptions("exemplar", weights="owner/name")
    with pytest.raises(ValueError, match="for weights that are named"):
        PriorOptions("mvdream", variant="fp16")
    assert PriorOptions("owner/name", variant="fp16").source() == Source("owner/name", variant="fp16")


def test_a_folder_without_a_network_is_no_prior(tmp_path, capsys):
    said = fails(["text", "a chair", "--prior", str(tmp_path), "-o", str(tmp_path / "out")], capsys)
    assert "has no folder unet" in said


def test_a_wrong_batch_is_said_before_weights_are_sought(tmp_path, capsys):
    arguments = ["text", "a chair", "--prior", "mvdream", "--batch", "6", "-o", str(tmp_path / "out")]
    assert "batch must be a multiple of 4" in fails(arguments, capsys)


@pytest.mark.slow
def test_every_method_has_its_own_sketch(checkpoints, drawing, tmp_path):
    """One method per folder, all from one seed: none is another in disguise."""
    methods = ["sds", "reconstruction", "csd", "nfsd", "asd", "ism", "sdi", "vsd"]
    for method in methods:
        main(command("mvdream", checkpoints, drawing, tmp_path / method, "--method", method, "--steps", "2"))
    sketches = {(tmp_path / method / "sketch.json").read_bytes() for method in methods}
    assert len(sketches) == len(methods)


def test_perpendicular_negatives_run(checkpoints, drawing, tmp_path, capsys):
    main(command("stable-diffusion", checkpoints, drawing, tmp_path / "sd", "--perp-neg", "--steps", "2"))
    wrong = command("mvdream", checkpoints, drawing, tmp_path / "mv", "--perp-neg")
    assert "--perp-neg is for stable-diffusion" in fails(wrong, capsys)


@pytest.mark.parametrize(
    ("prior", "method", "more"),
    [
        ("mvdream", None, []),
        pytest.param("stable-diffusion", "nfsd", ["--perp-neg", "--negative", "a table"], marks=pytest.mark.slow),
        pytest.param("zero123", "vsd", [], marks=pytest.mark.slow),
        pytest.param("mvdream", "nfsd", [], marks=pytest.mark.slow),
        pytest.param("mvdream", "vsd", [], marks=pytest.mark.slow),
        pytest.param("stable-diffusion", "sds", ["--perp-neg"], marks=pytest.mark.slow),
        pytest.param("stable-diffusion", "csd", ["--perp-neg"], marks=pytest.mark.slow),
        pytest.param("stable-diffusion", "asd", ["--perp-neg"], marks=pytest.mark.slow),
        pytest.param("zero123", "nfsd", [], marks=pytest.mark.slow),
    ],
)
def test_memory_is_asked_for_what_the_network_is_shown(
    prior, method, more, checkpoints, drawing, tmp_path, monkeypatch
):
    module = importlib.import_module(f"diff3ds.guidance.networks.{prior.replace('-', '_')}")
    asked, shown, trained = [], [], []
    check, predict = module.check_memory, module.predict_noise

    def record_work(shapes, size, work, *others):
        asked.append(work)
        check(shapes, size, work, *others)

    def record_pass(unet, noisy, timesteps, contexts, *others, **more):
        shown.append((len(noisy), len(contexts)))
        trained.append(torch.is_grad_enabled())
        return predict(unet, noisy, timesteps, contexts, *others, **more)

    monkeypatch.setattr(module, "check_memory", record_work)
    monkeypatch.setattr(module, "predict_noise", record_pass)
    arguments = command(prior, checkpoints, drawing, tmp_path, "--steps", "1", *more)
    main([*arguments, *(["--method", method] if method else [])])
    assert asked == [Work(*max(shown), trained=any(trained))]


@pytest.mark.parametrize(
    ("precision", "advice"),
    [
        pytest.param("float16", "start anew with --precision bfloat16", marks=pytest.mark.slow),
        ("float32", "may be damaged"),
    ],
)
def test_a_network_that_predicts_no_numbers_stops_the_run(precision, advice, tmp_path, capsys):
    folder = save_mvdream(tmp_path / "weights", "stock")
    file = folder / "unet" / "diffusion_pytorch_model.safetensors"
    weights = load_file(file)
    weights["conv_out.bias"][:] = torch.nan
    save_file(weights, file)
    out = tmp_path / "out"
    said = fails(command("mvdream", {"mvdream": folder}, None, out, "--precision", precision), capsys)
    assert "the loss of step 0 is nan" in said
    assert advice in said
    assert not (out / "sketch.json").exists()


def test_a_disk_that_fills_up_ends_in_one_line(checkpoints, tmp_path, monkeypatch, capsys):
    def full(*arguments):
        raise SafetensorError("I/O error: No space left on device (os error 28)")

    monkeypatch.setattr("safetensors.torch.save_file", full)
    said = fails(command("mvdream", checkpoints, None, tmp_path / "out", "--steps", "1"), capsys)
    assert "make room. What was written before is whole; a run with a checkpoint goes on by --resume" in said
    assert "Traceback" not in said


@pytest.mark.parametrize("prior", [pytest.param("mvdream", marks=pytest.mark.slow), "stable-diffusion"])
def test_networks_draw_scenes_thing_by_thing(prior, checkpoints, drawing, tmp_path, capsys):
    """Each thing is a prompt of its own; with --whole, or with words that the library lacks, the phrase is one."""
    arguments = command(prior, checkpoints, drawing, tmp_path / "out", "--steps", "1")
    arguments[1] = "an old table with a mug on it and two red chairs"
    main([argument for argument in arguments if argument != "--quiet"])
    said = "'an old table', 'a mug', 'a red chair': drawn one after the other, then placed"
    assert said in " ".join(capsys.readouterr().err.split())
    folders = sorted((tmp_path / "out/things").iterdir())
    runs = [json.loads((folder / "run.json").read_text())["options"] for folder in folders]
    assert [run["phrase"] for run in runs] == ["an old table", "a mug", "a red chair"]
    assert [run["prior"] for run in runs] == [prior] * 3
    table, mug, chair = (ds.load(folder / "sketch.json") for folder in folders)
    whole = ds.load(tmp_path / "out/sketch.json")
    assert len(whole) == len(table) + len(mug) + 2 * len(chair)
    # The mug stands on the table: as high as its top, or higher.
    placed = whole.points[len(table) : len(table) + len(mug), :, 2]
    assert placed.mean() > whole.points[: len(table), :, 2].mean()
    for more, phrase in ((["--whole"], arguments[1]), ([], "a corgi and a chair"), ([], "a chair and a tabel")):
        arguments[1] = phrase
        main([*arguments, *more, "--overwrite"])
        assert not (tmp_path / "out/things").exists()
        assert json.loads((tmp_path / "out/run.json").read_text())["options"]["phrase"] == phrase


def test_a_phrase_as_a_whole_is_for_networks(tmp_path, capsys):
    arguments = ["text", "a chair and a table", "--whole", "--prior", "exemplar", "-o", str(tmp_path / "no")]
    assert "--whole is for networks" in fails(arguments, capsys)
    assert not (tmp_path / "no").exists()


def test_the_suffix_follows_the_phrase(checkpoints):
    """As MVDream's own scripts for pictures join the two."""
    options = PriorOptions("mvdream", weights=str(checkpoints["mvdream"]), device="cpu")
    plain, suffixed = (
        load_for_phrase("mvdream", Phrase(phrase, suffix=suffix), options, USUAL)
        for phrase, suffix in (("a chair, 3d asset", ""), (" a chair ", ", 3d asset"))
    )
    assert torch.equal(plain._texts["conditional"], suffixed._texts["conditional"])
    with pytest.raises(ValueError, match="the phrase is empty"):
        load_for_phrase("mvdream", Phrase(" ", suffix=", 3d asset"), options, USUAL)


def test_a_suffix_is_kept_in_the_run_and_refused_by_the_built_in_prior(checkpoints, drawing, tmp_path, capsys):
    main(command("stable-diffusion", checkpoints, drawing, tmp_path / "out", "--suffix", ", 3d asset"))
    assert json.loads((tmp_path / "out" / "run.json").read_text())["options"]["suffix"] == ", 3d asset"
    arguments = ["text", "a chair", "--prior", "exemplar", "--suffix", ", 3d asset", "-o", str(tmp_path / "no")]
    assert "a suffix is for mvdream and stable-diffusion" in fails(arguments, capsys)
    assert not (tmp_path / "no").exists()


def test_a_negative_phrase_that_would_be_ignored_is_refused(checkpoints, drawing, tmp_path, capsys):
    arguments = command("mvdream", checkpoints, drawing, tmp_path / "out", "--method", "csd", "--negative", "a table")
    assert "leave --negative out" in fails(arguments, capsys)


def test_what_was_loaded_is_recorded_and_a_resumed_run_has_the_same(checkpoints, drawing, tmp_path, capsys):
    arguments = command("stable-diffusion", checkpoints, drawing, tmp_path / "run", "--steps", "1")
    main([*arguments, "--precision", "bfloat16"])
    weights = str(checkpoints["stable-diffusion"])
    network = json.loads((tmp_path / "run" / "run.json").read_text())["network"]
    assert network == {"weights": weights, "device": "cpu", "precision": "bfloat16"}
    said = fails([*arguments, "--resume"], capsys)
    assert "the run to resume had --precision=bfloat16, not float32: give the same, or start a new run" in said
    main([*arguments, "--resume", "--precision", "bfloat16"])


def test_weights_of_the_hub_are_recorded_with_their_commit(tmp_path, monkeypatch):
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    known, commit = KNOWN["mvdream"].repositories[1].id, 40 * "a"
    place = tmp_path / "hub" / f"models--{known.replace('/', '--')}"
    save_mvdream(place / "snapshots" / commit, "stock")
    (place / "refs").mkdir()
    (place / "refs" / "main").write_text(commit)
    main(["text", "a chair", "--prior", "mvdream", "-o", str(tmp_path / "run"), *QUICK, "--steps", "1"])
    network = json.loads((tmp_path / "run" / "run.json").read_text())["network"]
    assert network["weights"] == f"{known}@{commit}"


def test_the_picture_that_was_taken_is_kept(checkpoints, drawing, tmp_path):
    main(command("zero123", checkpoints, drawing, tmp_path, "--steps", "2", "--reference-loss", "100"))
    kept = ds.formats.load_image(tmp_path / "reference.png")
    assert torch.allclose(kept, read_reference(drawing).image, atol=1 / 255)


def test_what_is_known_of_a_licence_is_said(checkpoints, drawing, tmp_path, capsys):
    arguments = command("stable-zero123", checkpoints, drawing, tmp_path, "--steps", "1")
    arguments.remove("--quiet")
    main(arguments)
    assert "non-commercial" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "warned"),
    [
        (["--view-elevation", "40"], True),
        (["--view-elevation", "40", "--elevation", "0", "45"], False),
        pytest.param(["--view-elevation", "30"], False, marks=pytest.mark.slow),
    ],
)
def test_a_view_that_no_camera_comes_by_is_warned_of(more, warned, checkpoints, drawing, tmp_path, capsys):
    arguments = command("zero123", checkpoints, drawing, tmp_path, "--steps", "1", *more)
    arguments.remove("--quiet")
    main(arguments)
    said = " ".join(capsys.readouterr().err.split())
    assert ("--view-elevation 40 lies outside --elevation 0 30" in said) is warned


def test_wrong_input_is_refused_before_any_file_is_written(checkpoints, drawing, tmp_path, capsys):
    out = tmp_path / "out"
    clear = tmp_path / "clear.png"
    Image.new("RGBA", (64, 64)).save(clear)
    text = tmp_path / "text.png"
    text.write_text("no picture")
    for arguments, message in [
        (["text", " ", *command("mvdream", checkpoints, drawing, out)[2:]], "phrase"),
        (["text", "chair " * 60, *command("mvdream", checkpoints, drawing, out)[2:]], "77"),
        (["image", str(clear), *command("zero123", checkpoints, drawing, out)[2:]], "transparent everywhere"),
        (["image", str(text), *command("zero123", checkpoints, drawing, out)[2:]], "cannot be read as a picture"),
        (["image", str(tmp_path / "none.png"), *command("zero123", checkpoints, drawing, out)[2:]], "none.png"),
        (command("zero123", checkpoints, drawing, out, "--prior", "mvdream"), "this command needs one of zero123"),
        (command("mvdream", checkpoints, drawing, out, "--prior", "dall-e"), "prior must be one of mvdream"),
        (command("mvdream", checkpoints, drawing, out, "--batch", "6"), "batch must be a multiple of 4"),
        (command("mvdream", checkpoints, drawing, out, "--device", "tpu"), "no device 'tpu' here"),
        (command("mvdream", checkpoints, drawing, out, "--resume"), "no checkpoint to resume from"),
        (command("stable-zero123", checkpoints, drawing, out, "--distance", "1.5", "2"), "sees from 2.0 only"),
        (["text", "a chair", "--prior", str(checkpoints["zero123"]), "-o", str(out)], "this command needs one of"),
        (["text", "a chair", "--prior", "nobody/nothing", "-o", str(out)], "nobody/nothing is not on this disk"),
    ]:
        assert message in fails(arguments, capsys)
        assert not out.exists()


def test_a_run_is_not_lost(checkpoints, drawing, tmp_path, capsys):
    arguments = command("stable-diffusion", checkpoints, drawing, tmp_path, "--steps", "1")
    main(arguments)
    before = (tmp_path / "run.json").read_bytes()
    assert "holds a run" in fails(arguments, capsys)
    assert (tmp_path / "run.json").read_bytes() == before
    main([*arguments, "--overwrite"])
    assert "had --seed=0, not 1" in fails([*arguments, "--resume", "--seed", "1"], capsys)
