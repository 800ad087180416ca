"""Files of networks: found on this disk, converted from pickles by the command that the error gives, errors."""

import subprocess
import sys
import warnings
from pathlib import Path

import pytest
import torch
from needs import needs
from safetensors.torch import save_file

from diff3ds.weights.judge_files import find_file, find_folder, read_network

pytestmark = needs("huggingface_hub")


@pytest.fixture
def hub(tmp_path, monkeypatch):
    """The hub's cache with one repository."""
    from huggingface_hub import constants

    snapshot = tmp_path / "hub" / "models--someone--a-model" / "snapshots" / "abc"
    snapshot.mkdir(parents=True)
    (snapshot / "model.safetensors").touch()
    reference = snapshot.parents[1] / "refs" / "main"
    reference.parent.mkdir()
    reference.write_text("abc")
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    return snapshot


def test_files_and_folders_are_found_by_path_or_name(hub, tmp_path):
    assert find_folder("someone/a-model", "a net") == hub
    assert find_folder(str(hub), "a net") == hub
    for text in ("someone/a-model", "someone/a-model@abc", str(hub), str(hub / "model.safetensors")):
        assert find_file(text, "a net", "model.safetensors") == hub / "model.safetensors"


def test_what_is_not_there_is_named_with_the_command_that_gets_it(hub):
    with pytest.raises(
        FileNotFoundError, match=r"VGG16: timm/vgg is not on this disk. Get it with\n  hf download timm/vgg x.st$"
    ):
        find_file("timm/vgg", "VGG16", "x.st")
    with pytest.raises(FileNotFoundError, match=r"hf download someone/a-model --revision v2$"):
        find_folder("someone/a-model@v2", "a net")
    with pytest.raises(FileNotFoundError, match=r"a net: .* has no other.safetensors"):
        find_file(str(hub), "a net", "other.safetensors")
    with pytest.raises(ValueError, match="a net: weights must be a folder or file that exists"):
        find_file("no/such/place", "a net", "x")
    with pytest.raises(ValueError, match="is a file; give the folder"):
        find_folder(str(hub / "model.safetensors"), "a net")


@pytest.mark.parametrize("kind", ["state dict", pytest.param("TorchScript", marks=pytest.mark.slow)])
def test_pickles_are_refused_with_the_command_that_converts_them(kind, tmp_path):
    path = tmp_path / "net.pth"
    layer = torch.nn.Linear(2, 3)
    if kind == "state dict":
        torch.save(layer.half().state_dict(), path)
    else:
        with warnings.catch_warnings(action="ignore"):
            torch.jit.script(torch.nn.Linear(2, 3)).save(str(path))
    with pytest.raises(ValueError, match="convert it once") as refusal:
        read_network(path)
    assert ("TorchScript" in str(refusal.value)) == (kind == "TorchScript")
    command = str(refusal.value).split("\n")[1].strip()
    # `python` is the one that runs the tests.
    environment = {"PATH": str(Path(sys.executable).parent)}
    subprocess.run(["/bin/sh", "-c", command], check=True, env=environment, capture_output=True)
    tensors = read_network(tmp_path / "net.safetensors")
    assert {name: tuple(t.shape) for name, t in tensors.items()} == {"weight": (3, 2), "bias": (3,)}
    assert tensors["weight"].dtype == torch.float32
    if kind == "state dict":
        assert torch.equal(tensors["weight"], layer.weight.float())
        # Allowed by name, it is read without conversion.
        assert torch.equal(read_network(path, [tmp_path / "." / "net.pth"])["weight"], layer.weight)
        with pytest.raises(ValueError, match="convert it once"):
            read_network(path, [tmp_path / "another.pth"])
    else:
        with pytest.raises(ValueError, match="a TorchScript archive, which is a program"):
            read_network(path, [path])


def test_damaged_files_are_refused(tmp_path):
    (tmp_path / "x.safetensors").write_bytes(b"not at all")
    with pytest.raises(ValueError, match="not a safetensors file"):
        read_network(tmp_path / "x.safetensors")
    save_file({"a": torch.ones(2)}, tmp_path / "y.safetensors")
    assert torch.equal(read_network(tmp_path / "y.safetensors")["a"], torch.ones(2))
