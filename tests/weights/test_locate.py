"""Where weights are looked for, what is said when they are missing, and that they load whole or not at all."""

import json
import logging
import re
import shutil

import pytest
import tiny
import torch
from huggingface_hub import constants
from needs import needs
from safetensors.torch import load_file, save_file

from diff3ds.guidance.networks.stable_diffusion import load_stable_diffusion
from diff3ds.weights import locate as locating
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.locate import Checkpoint, find, lacking, locate, needed
from diff3ds.weights.read import header, load_part, load_tensors, read_tensors
from diff3ds.weights.weight_options import Source

pytestmark = needs("diffusers", "ftfy")

COMMIT = "4e63672c03103b6c636b8fb4119ba982469b2955"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tiny.save_stable_diffusion(tmp_path_factory.mktemp("sd"))


@pytest.fixture
def copy(folder, tmp_path):
    """A checkpoint of which a test may break something."""
    return shutil.copytree(folder, tmp_path / "copy")


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache of the hub."""
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    return tmp_path / "hub"


def put(folder, cache, name, commit=COMMIT, branch=None):
    """A checkpoint as the hub's client leaves it in its cache."""
    root = cache / f"models--{name.replace('/', '--')}"
    shutil.copytree(folder, root / "snapshots" / commit)
    if branch:
        (root / "refs").mkdir()
        (root / "refs" / branch).write_text(commit)
    return root / "snapshots" / commit


# Sources


def test_sources_are_paths_or_repositories(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert Source.parse("owner/name") == Source("owner/name")
    assert Source.parse("owner/name@main", "fp16") == Source("owner/name", "main", "fp16")
    (tmp_path / "owner" / "name").mkdir(parents=True)
    (tmp_path / "owner" / "na@me").mkdir()
    assert locate(Source.parse("owner/name")) == Checkpoint(tmp_path.relative_to(tmp_path) / "owner" / "name")
    assert Source.parse("owner/na@me") == Source("owner/na@me")
    assert str(Source("owner/name", "v1")) == "owner/name@v1"


@pytest.mark.parametrize("text", ["nowhere", "/no/such/folder", "./a/b/c", ""])
def test_what_is_neither_is_refused(text):
    with pytest.raises(ValueError, match=r"a folder or file that exists or owner/name"):
        Source.parse(text)


# Finding


def test_the_cache_of_the_hub_is_searched_by_commit_and_by_branch(folder, cache):
    assert locate(Source("a/b")) is None
    snapshot = put(folder, cache, "a/b", branch="main")
    assert locate(Source("a/b")).path == snapshot
    assert locate(Source("a/b", "main")).path == snapshot
    assert locate(Source("a/b", COMMIT)).path == snapshot
    assert locate(Source("a/b", "other")) is None


def test_weights_are_named_by_what_they_are(folder, cache, tmp_path):
    """A folder by its whole path, a repository by its commit, and half precision as another file."""
    assert Checkpoint(folder).origin() == str(folder)
    snapshot = put(folder, cache, "a/b", branch="main")
    assert locate(Source("a/b")).origin() == locate(Source("a/b", COMMIT)).origin() == f"a/b@{COMMIT}"
    file = snapshot / "unet" / "diffusion_pytorch_model.safetensors"
    file.rename(file.with_name("diffusion_pytorch_model.fp16.safetensors"))
    assert locate(Source("a/b")).origin() == f"a/b@{COMMIT} fp16"
    (tmp_path / "one.safetensors").touch()
    assert locate(Source(str(tmp_path / "one.safetensors"))).origin() == str(tmp_path / "one.safetensors")


def test_the_first_complete_mirror_is_taken(folder, cache):
    first, second = KNOWN["stable-diffusion"].repositories[:2]
    broken = put(folder, cache, first.id, first.revision)
    (broken / "vae" / "diffusion_pytorch_model.safetensors").unlink()
    complete = put(folder, cache, second.id, branch=second.revision)
    assert find("stable-diffusion").path == complete


def test_missing_weights_are_named_with_the_command_that_gets_them(folder, cache):
    first = KNOWN["stable-diffusion"].repositories[0]
    broken = put(folder, cache, first.id, first.revision)
    (broken / "vae" / "diffusion_pytorch_model.safetensors").unlink()
    shutil.rmtree(broken / "scheduler")
    with pytest.raises(FileNotFoundError) as error:
        load_stable_diffusion("a cat")
    message = str(error.value)
    assert f"{first.id}@{first.revision}: {broken} lacks vae/diffusion_pytorch_model.safetensors, scheduler/" in message
    assert "Manojb/stable-diffusion-2-1-base@main: not on this disk" in message
    assert "Get them (2.6 GB): diff3ds fetch stable-diffusion\n" in message


def test_a_source_that_the_user_names_is_the_only_one(folder, cache):
    first = KNOWN["stable-diffusion"].repositories[0]
    put(folder, cache, first.id, first.revision)
    with pytest.raises(FileNotFoundError, match="diff3ds fetch stable-diffusion --weights a/b@v1"):
        find("stable-diffusion", Source("a/b", "v1"))


def test_only_some_parts_can_be_asked_for(copy):
    shutil.rmtree(copy / "unet")
    assert find("stable-diffusion", Source(str(copy)), ("text_encoder", "tokenizer")).path == copy
    with pytest.raises(FileNotFoundError, match="lacks unet/"):
        find("stable-diffusion", Source(str(copy)))


def test_the_extra_is_asked_for_by_name(monkeypatch):
    monkeypatch.setattr(locating.importlib.util, "find_spec", lambda name: None if name == "diffusers" else name)
    with pytest.raises(ImportError, match=re.escape('priors need diffusers: pip install "diff3ds[diffusion]"')):
        find("mvdream")


# Files of a repository. Names as they are in published ones.

REPOSITORY = [
    "README.md",
    "model_index.json",
    "unet/config.json",
    "unet/diffusion_pytorch_model.bin",
    "unet/diffusion_pytorch_model.safetensors",
    "unet/diffusion_pytorch_model.fp16.safetensors",
    "clip_camera_projection/config.json",
    "clip_camera_projection/diffusion_pytorch_model.safetensors",
    "text_encoder/config.json",
    "text_encoder/model.safetensors",
    "text_encoder/pytorch_model.bin",
    "tokenizer/vocab.json",
    "tokenizer/merges.txt",
    "tokenizer/tokenizer_config.json",
    "scheduler/scheduler_config.json",
]
PARTS = ("unet", "clip_camera_projection|cc_projection", "text_encoder", "tokenizer", "scheduler", "camera_proj?")


def test_half_of_the_precision_is_fetched_where_there_is_a_choice():
    assert lacking(REPOSITORY, PARTS) == []
    assert needed(REPOSITORY, PARTS) == [
        "unet/config.json",
        "unet/diffusion_pytorch_model.fp16.safetensors",
        "clip_camera_projection/config.json",
        "clip_camera_projection/diffusion_pytorch_model.safetensors",
        "text_encoder/config.json",
        "text_encoder/model.safetensors",
        "tokenizer/merges.txt",
        "tokenizer/tokenizer_config.json",
        "tokenizer/vocab.json",
        "scheduler/scheduler_config.json",
    ]


def test_the_optional_part_is_fetched_where_it_is():
    extra = ["camera_proj/config.json", "camera_proj/diffusion_pytorch_model.safetensors"]
    assert needed([*REPOSITORY, *extra], ("camera_proj?",)) == extra


def test_what_is_lacking():
    without = [n for n in REPOSITORY if n not in ("tokenizer/vocab.json", "unet/config.json")]
    assert lacking(without, PARTS) == ["unet/config.json", "tokenizer/tokenizer.json"]
    pickled = [n for n in REPOSITORY if not (n.startswith("unet") and n.endswith("safetensors"))]
    assert lacking(pickled, PARTS) == ["unet/diffusion_pytorch_model.safetensors (only a pickle)"]
    assert lacking([], ("clip_camera_projection|cc_projection",)) == ["clip_camera_projection/ or cc_projection/"]
    assert lacking(REPOSITORY, ("unet",), "ema") == ["unet/diffusion_pytorch_model.ema.safetensors (only a pickle)"]


def test_a_variant_is_the_networks_and_other_parts_need_not_have_it():
    """Averaged weights (fp16_ema) are published of the UNet alone."""
    averaged = "unet/diffusion_pytorch_model.fp16_ema.safetensors"
    files = [*REPOSITORY, averaged, "text_encoder/model.fp16.safetensors"]
    assert lacking(files, ("unet", "text_encoder"), "fp16_ema") == []
    assert needed(files, ("unet", "text_encoder"), "fp16_ema") == [
        "unet/config.json",
        averaged,
        "text_encoder/config.json",
        "text_encoder/model.fp16.safetensors",
    ]
    assert needed(files, ("unet",), "fp16")[-1] == "unet/diffusion_pytorch_model.fp16.safetensors"


# Loading


def unet_of(folder, **changes):
    from diffusers import UNet2DConditionModel

    return load_part(UNet2DConditionModel, Checkpoint(folder, **changes), "unet", torch.float32)


def test_a_part_is_loaded_as_it_was_saved(copy):
    unet = unet_of(copy)
    saved = load_file(copy / "unet" / "diffusion_pytorch_model.safetensors")
    assert unet.state_dict().keys() == saved.keys()
    assert all(torch.equal(tensor, saved[name]) for name, tensor in unet.state_dict().items())
    assert not unet.training
    assert not any(p.requires_grad for p in unet.parameters())


def test_a_variant_is_taken_where_it_is_all_there_is_or_asked_for(copy):
    plain = copy / "unet" / "diffusion_pytorch_model.safetensors"
    half = copy / "unet" / "diffusion_pytorch_model.fp16.safetensors"
    save_file({n: t.half() for n, t in load_file(plain).items()}, half)
    assert Checkpoint(copy).file("unet") == plain
    assert Checkpoint(copy, "fp16").file("unet") == half
    rounded = unet_of(copy, variant="fp16")
    assert rounded.dtype == torch.float32
    assert torch.equal(rounded.conv_in.weight, unet_of(copy).conv_in.weight.half().float())
    plain.unlink()
    assert torch.equal(unet_of(copy).conv_in.weight, rounded.conv_in.weight)
    with pytest.raises(FileNotFoundError, match=r"has no diffusion_pytorch_model\.ema\.safetensors"):
        unet_of(copy, variant="ema")


@pytest.fixture
def heard():
    """What the libraries log."""
    records: list[logging.LogRecord] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            records.append(record)

    loggers, listener = [logging.getLogger(name) for name in ("diffusers", "transformers")], Listener()
    for logger in loggers:
        logger.addHandler(listener)
    yield records
    for logger in loggers:
        logger.removeHandler(listener)


@pytest.mark.parametrize("part", ["unet", "vae", "text_encoder"])
@pytest.mark.parametrize("change", ["drop", "add", "reshape"])
def test_weights_that_do_not_fit_are_named_by_nobody_else(copy, part, change, heard):
    """The libraries' own reports, of several lines, say less."""
    import diffusers
    import transformers

    kinds = {"unet": diffusers.UNet2DConditionModel, "vae": diffusers.AutoencoderKL}
    kind = kinds.get(part, transformers.CLIPTextModel)
    file = Checkpoint(copy).file(part)
    tensors = load_file(file)
    name = sorted(n for n in tensors if n.endswith("weight"))[3]
    if change == "drop":
        del tensors[name]
    if change == "add":
        tensors["foreign.weight"] = torch.zeros(3)
        name = "foreign.weight"
    if change == "reshape":
        tensors[name] = torch.zeros(3, 3)
    save_file(tensors, file, metadata={"format": "pt"})
    # transformers names its weights without the prefix of old files.
    with pytest.raises(ValueError, match=re.escape(name.removeprefix("text_model."))):
        load_part(kind, Checkpoint(copy), part, torch.float32)
    assert not heard
    # They speak again afterwards.
    logging.getLogger("diffusers.models").warning("as before")
    assert [record.getMessage() for record in heard] == ["as before"]


def test_old_names_still_load(copy):
    """Text encoders and autoencoders of the published repositories have names of earlier versions."""
    import diffusers
    import transformers

    file = Checkpoint(copy).file("text_encoder")
    new = {n.removeprefix("text_model."): t for n, t in load_file(file).items()}
    old = {f"text_model.{n}": t for n, t in new.items()}
    old["text_model.embeddings.position_ids"] = torch.arange(77)[None]
    save_file(old, file, metadata={"format": "pt"})
    encoder = load_part(transformers.CLIPTextModel, Checkpoint(copy), "text_encoder", torch.float32)
    assert torch.equal(encoder.get_input_embeddings().weight, new["embeddings.token_embedding.weight"])

    file = Checkpoint(copy).file("vae")
    new = load_file(file)
    names = {"to_q": "query", "to_k": "key", "to_v": "value", "to_out.0": "proj_attn"}
    old = {}
    for name, tensor in new.items():
        for now, before in names.items():
            name = name.replace(f".{now}.", f".{before}.")
        old[name] = tensor
    assert old.keys() != new.keys()
    save_file(old, file, metadata={"format": "pt"})
    vae = load_part(diffusers.AutoencoderKL, Checkpoint(copy), "vae", torch.float32)
    assert all(torch.equal(tensor, new[name]) for name, tensor in vae.state_dict().items())


def test_own_models_are_loaded_as_strictly():
    model = torch.nn.Linear(2, 3)
    load_tensors(model, {"weight": torch.ones(3, 2), "bias": torch.ones(3)}, torch.float16, "it")
    assert model.weight.dtype == torch.float16
    assert not model.weight.requires_grad
    with pytest.raises(ValueError, match="it: not the weights of this model: it lacks bias; it has foreign other"):
        load_tensors(model, {"weight": torch.ones(3, 2), "other": torch.ones(3)}, torch.float32, "it")
    with pytest.raises(ValueError, match=r"bias must have shape \(3,\), got \(2,\)"):
        load_tensors(model, {"weight": torch.ones(3, 2), "bias": torch.ones(2)}, torch.float32, "it")


# Files


class Attack:
    """Unpickled as a call."""

    def __reduce__(self):
        return print, ("attacked",)


def test_only_tensors_are_unpickled_and_only_when_trusted(tmp_path, capsys):
    file, tensors = tmp_path / "a.pt", {"a": torch.ones(2)}
    torch.save(tensors, file)
    with pytest.raises(ValueError, match="not safetensors but a pickle"):
        read_tensors(file)
    assert torch.equal(read_tensors(file, trust_pickle=True)["a"], tensors["a"])
    torch.save({"state_dict": tensors}, file)
    assert read_tensors(file, trust_pickle=True).keys() == {"a"}
    for content in ({"a": Attack()}, {"state_dict": tensors, "b": Attack()}):
        torch.save(content, file)
        with pytest.raises(ValueError, match=r"it holds \S*print, which is no tensor. Nothing was read") as raised:
            read_tensors(file, trust_pickle=True)
        # torch would say how to run the code.
        assert "weights_only" not in str(raised.value)
    for content in ([torch.ones(1)], {"a": 1}, {}):
        torch.save(content, file)
        with pytest.raises(ValueError, match="expected a dictionary of tensors"):
            read_tensors(file, trust_pickle=True)
    assert "attacked" not in capsys.readouterr().out


@pytest.mark.parametrize("content", [b"", b"no pickle", b"PK\x03\x04 no archive"])
def test_a_damaged_pickle_is_an_error_of_one_line(tmp_path, content):
    file = tmp_path / "a.pt"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.pt: not a file of tensors alone.* damaged"):
        read_tensors(file, trust_pickle=True)


def test_a_file_that_is_not_what_it_says(tmp_path):
    file = tmp_path / "a.safetensors"
    file.write_bytes(b"no weights")
    for read in (read_tensors, header):
        with pytest.raises(ValueError, match=r"a\.safetensors: not a safetensors file"):
            read(file)


def test_a_truncated_download_is_noticed(copy):
    file = Checkpoint(copy).file("unet")
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(ValueError, match=r"diffusion_pytorch_model\.safetensors: not a safetensors file"):
        load_stable_diffusion("a cat", source=Source(str(copy)), device="cpu")


def test_shapes_are_read_without_the_weights(folder):
    file = Checkpoint(folder).file("unet")
    assert header(file) == {name: tuple(tensor.shape) for name, tensor in load_file(file).items()}


def test_a_configuration_that_is_no_object(copy):
    (copy / "unet" / "config.json").write_text(json.dumps([1]))
    with pytest.raises(ValueError, match="expected a JSON object"):
        Checkpoint(copy).config("unet")
