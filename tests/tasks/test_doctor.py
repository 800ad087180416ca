"""What doctor finds: packages, GPUs, weights whole and broken, and commands that can be copied."""

import dataclasses
import importlib.metadata
import importlib.util
import json
import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from gpu_promise import need
from huggingface_hub import constants
from rich.console import Console
from tiny_zero123 import save_zero123

from diff3ds.tasks.doctor import diagnosis as doctor
from diff3ds.tasks.doctor.diagnosis import as_json, as_tables, diagnose
from diff3ds.tasks.evaluate.judges import JudgeOptions
from diff3ds.tasks.text_image.prior_options import BUILT_IN
from diff3ds.tasks.views.color_fit.doodle import DoodleOptions
from diff3ds.weights.catalog import KNOWN

REPOSITORY = KNOWN["zero123"].repositories[0].id
COMMIT = 40 * "1"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """An empty cache of the hub."""
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    return tmp_path / "hub"


def prior(diagnosis, name="zero123"):
    (found,) = (prior for prior in diagnosis.priors if prior.name == name)
    return found


def package(diagnosis, name):
    (found,) = (package for package in diagnosis.packages if package.name == name)
    return found


def printed(diagnosis, width=80):
    console = Console(width=width, color_system=None)
    with console.capture() as capture:
        console.print(as_tables(diagnosis))
    return capture.get()


def test_every_optional_package_of_the_project_is_looked_for():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    for extra, requirements in project["optional-dependencies"].items():
        # The last two are for who works on the project; the network of "networks" stands among the priors.
        if extra not in ("all", "networks", "dev", "docs"):
            names = {re.match(r"[\w-]+", requirement)[0] for requirement in requirements}
            assert names <= set(doctor.OPTIONAL.get(extra, ()))
    found = {package.name for package in diagnose().packages}
    assert found - {"NVRTC"} == {name for names in doctor.OPTIONAL.values() for name in names}


def test_the_page_on_installing_names_every_extra():
    root = Path(__file__).parents[2]
    extras = tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    rows = re.findall(r"^\| `(\w+)` \|.*\| (yes|no) \|$", (root / "docs/start/install.md").read_text(), re.MULTILINE)
    in_all = re.search(r"\[(.*)\]", extras.pop("all")[0])[1].split(",")
    assert dict(rows) == {extra: "yes" if extra in in_all else "no" for extra in extras}


def test_the_compiler_for_gpus_fits_torch(monkeypatch):
    need("cuda.bindings.nvrtc")
    nvrtc = importlib.import_module("cuda.bindings.nvrtc")
    version = ".".join(map(str, nvrtc.nvrtcVersion()[1:]))
    ours, older = version.split(".")[0], int(version.split(".")[0]) - 1
    monkeypatch.setattr(torch.version, "cuda", f"{ours}.0")
    assert package(diagnose(), "NVRTC") == doctor.Finding("NVRTC", version)
    monkeypatch.setattr(torch.version, "cuda", f"{older}.9")
    assert package(diagnose(), "NVRTC").advice.endswith(f'pip install "cuda-bindings=={older}.*"')

    def fails():
        raise RuntimeError("Failure finding libnvrtc.so")

    monkeypatch.setattr(torch.version, "cuda", None)
    monkeypatch.setattr(nvrtc, "nvrtcVersion", fails)
    missing = package(diagnose(), "NVRTC")
    assert missing.found is None
    assert "pip install nvidia-cuda-nvrtc" in missing.advice
    assert "Failure finding" in missing.advice


def test_installed_packages_have_their_version():
    import transformers

    assert package(diagnose(), "transformers").found == transformers.__version__
    assert package(diagnose(), "transformers").advice == ""


def test_missing_packages_come_with_the_command(monkeypatch):
    version = importlib.metadata.version

    def without(name):
        if name == "peft":
            raise importlib.metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(importlib.metadata, "version", without)
    found = package(diagnose(), "peft")
    assert (found.found, found.advice) == (None, 'pip install "diff3ds[diffusion]"')
    assert 'pip install "diff3ds[diffusion]"' in printed(diagnose(), 160)


def test_packages_that_do_not_import_are_said_to(monkeypatch):
    monkeypatch.setattr(doctor, "PROBES", {"transformers": "NoSuchThing"})
    found = package(diagnose(), "transformers")
    assert found.found is None
    assert re.fullmatch(r"5\S+ is installed but cannot be imported: .*NoSuchThing.*", found.advice)


def test_without_weights_there_are_commands():
    diagnosis = diagnose()
    assert [p.name for p in diagnosis.priors] == list(KNOWN)
    for known in diagnosis.priors:
        assert (known.folder, known.incomplete) == (None, ())
        assert known.command == f"diff3ds fetch {known.name}"
    assert "non-commercial" in prior(diagnosis, "stable-zero123").warning


def in_cache(cache):
    folder = cache / f"models--{REPOSITORY.replace('/', '--')}"
    (folder / "refs").mkdir(parents=True)
    (folder / "refs" / "main").write_text(COMMIT)
    return save_zero123(folder / "snapshots" / COMMIT)


def test_priors_that_are_built_in_are_ready(monkeypatch):
    """The network's weights are a package of their own."""
    assert tuple(found.name for found in diagnose().built_in) == BUILT_IN
    lines = printed(diagnose())
    for name in BUILT_IN:
        assert re.search(rf"^{name} +built in, ready +any machine *$", lines, re.MULTILINE)
    monkeypatch.setattr(doctor, "own_network", lambda: None)
    exemplar, small = diagnose().built_in
    assert (exemplar.found, exemplar.advice) == ("built in, ready", "")
    assert (small.found, small.advice) == (None, doctor.NOT_HERE)
    assert re.search(r'^small +pip install "diff3ds\[networks\]", or train one', printed(diagnose(), 160), re.MULTILINE)


def test_weights_are_found(cache):
    folder = in_cache(cache)
    found = prior(diagnose())
    assert (found.folder, found.command) == (str(folder), "")
    assert re.search(r"^zero123 +here ", printed(diagnose()), re.MULTILINE)


def test_what_incomplete_weights_lack(cache):
    (in_cache(cache) / "unet" / "diffusion_pytorch_model.safetensors").unlink()
    found = prior(diagnose())
    assert found.folder is None
    assert found.incomplete == (f"{REPOSITORY} lacks unet/diffusion_pytorch_model.safetensors",)
    assert found.command == "diff3ds fetch zero123"
    assert f"zero123: {REPOSITORY} lacks unet/diffusion_pytorch_model.safetensors" in printed(diagnose(), 160)


def judge(diagnosis, name):
    (found,) = (judge for judge in diagnosis.judges if judge.name == name)
    return found


def test_judges_are_found(cache, tmp_path, monkeypatch):
    """In the cache of the hub, of the main branch or of a pull request; or where torchvision keeps its files."""
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path / "torch"))
    missing = diagnose()
    assert (judge(missing, "blip").found, judge(missing, "blip").advice) == (None, "diff3ds fetch blip")
    assert judge(missing, "alexnet").advice.startswith("https://download.pytorch.org/models/alexnet-owt-7be5be79.pth")
    assert re.search(r"^clip-rn101 +--clip-rn101 +diff3ds fetch clip-rn101 *$", printed(missing), re.MULTILINE)
    for name, branch, files in (
        ("openai/clip-vit-base-patch16", "main", ["config.json", "model.safetensors", "vocab.json"]),
        ("openai/clip-vit-base-patch32", None, ["config.json", "model.safetensors", "tokenizer.json"]),
        ("Salesforce/blip-itm-large-coco", "main", ["config.json", "model.safetensors"]),
    ):
        folder = cache / f"models--{name.replace('/', '--')}"
        (folder / "snapshots" / COMMIT).mkdir(parents=True)
        for file in files:
            (folder / "snapshots" / COMMIT / file).touch()
        if branch:
            (folder / "refs").mkdir()
            (folder / "refs" / branch).write_text(COMMIT)
    alexnet = tmp_path / "torch" / "checkpoints" / "alexnet-owt-7be5be79.pth"
    alexnet.parent.mkdir(parents=True)
    alexnet.touch()
    there = diagnose()
    assert judge(there, "clip-b16").found == "openai/clip-vit-base-patch16"
    assert judge(there, "clip-b16").advice == ""
    assert judge(there, "clip-b32").found == f"openai/clip-vit-base-patch32@{COMMIT}"
    assert judge(there, "blip").found is None
    assert judge(there, "alexnet").advice == f"--allow-pickle {alexnet}"


def test_every_judge_has_an_option():
    options = {"--" + name.replace("_", "-") for kind in (JudgeOptions, DoodleOptions) for name in kind.__annotations__}
    assert {found.option for found in diagnose().judges} <= options


def test_priors_run_where_they_fit(monkeypatch):
    """Two GPUs, one with 4.5 GB free."""
    free = [int(4.5e9), int(70e9)]
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    properties = SimpleNamespace(name="A GPU", total_memory=80_000_000_000)
    monkeypatch.setattr(torch.cuda, "get_device_properties", lambda index: properties)
    monkeypatch.setattr(torch.cuda, "mem_get_info", lambda device: (free[device.index], 80_000_000_000))
    diagnosis = diagnose()
    assert [(d.name, d.about, d.free) for d in diagnosis.devices[:2]] == [
        ("cuda:0", "A GPU, 80 GB", free[0]),
        ("cuda:1", "A GPU, 80 GB", free[1]),
    ]
    for found in diagnosis.priors:
        assert found.devices == tuple(d for d, f in (("cuda:0", 4.5), ("cuda:1", 70.0)) if f >= found.memory)
    assert {found.devices for found in diagnosis.priors} == {("cuda:1",), ("cuda:0", "cuda:1")}
    assert not any(finding.name == "torch" and finding.advice for finding in diagnosis.base)
    free[:] = [0, 0]
    assert "GPUs too full" in printed(diagnose())

    def taken(device):
        raise RuntimeError("device is busy")

    monkeypatch.setattr(torch.cuda, "mem_get_info", taken)
    assert [device.free for device in diagnose().devices[:2]] == [None, None]
    assert prior(diagnose()).devices == ()


def test_eighty_columns_do():
    """Names and commands stay whole, to be copied."""
    lines = printed(diagnose()).splitlines()
    assert max(len(line) for line in lines) <= 80
    for name in KNOWN:
        assert any(line.startswith(f"{name} ") and f" diff3ds fetch {name} " in line for line in lines)


def test_json_says_the_same():
    diagnosis = diagnose()
    assert json.loads(as_json(diagnosis)) == json.loads(json.dumps(dataclasses.asdict(diagnosis)))
    assert set(json.loads(as_json(diagnosis))) == {
        "base",
        "packages",
        "devices",
        "weights",
        "built_in",
        "priors",
        "judges",
    }


def test_without_the_hubs_client_weights_cannot_be_found(monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "huggingface_hub" else find_spec(name)
    )
    diagnosis = diagnose()
    assert diagnosis.weights == doctor.Finding("weights", None, 'pip install "diff3ds[diffusion]"')
    assert prior(diagnosis).command == "diff3ds fetch zero123"
    assert judge(diagnosis, "blip").advice == "diff3ds fetch blip"


def test_forbidden_connections_are_named(monkeypatch):
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    assert diagnose().weights.advice == "HF_HUB_OFFLINE is set: unset it to fetch"
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", False)
    assert diagnose().weights.advice == ""


def test_only_the_reference_renders(monkeypatch):
    monkeypatch.setattr("diff3ds.tasks.doctor.diagnosis.available_backends", lambda: ["reference"])
    (found,) = (finding for finding in diagnose().base if finding.name == "renderers")
    assert (found.found, found.advice) == ("reference", doctor.KERNEL_ADVICE)
