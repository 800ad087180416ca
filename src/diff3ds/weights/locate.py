"""Finding the weights of a prior on this disk.

Nothing here downloads. Weights are looked for in a folder that the user names or in the cache of the Hugging Face hub,
in the layout of diffusers: a folder for each part. What is found is loaded by `read.py` and `pretrained.py`.
"""

import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff3ds._files import read_json
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.weight_options import Source

# Packages of the extra; peft, which only one method needs, is asked for there.
EXTRA = ("diffusers", "transformers", "accelerate", "huggingface_hub")
# Names of files with weights, without what follows; parts that are not listed here are diffusers models.
STEMS = {"text_encoder": "model", "image_encoder": "model"}
WITHOUT_WEIGHTS = {"scheduler": ("scheduler_config.json",), "tokenizer": ("tokenizer.json", "vocab.json")}


@dataclass(frozen=True)
class Checkpoint:
    """Weights that are on this disk.

    Attributes:
        path: a folder with a folder for each part, or a single file.
        variant: as `Source.variant`.
        trust_pickle: as `Source.trust_pickle`.
        repository: of the hub that the path is a copy of, owner/name@commit.
    """

    path: Path
    variant: str | None = None
    trust_pickle: bool = False
    repository: str | None = None

    def origin(self) -> str:
        """Which weights these are: repository and commit, or the path, and the variant of the UNet's file."""
        said = self.repository or str(self.path.resolve())
        return said if self.path.is_file() else " ".join([said, *self.file("unet").name.split(".")[1:-1]])

    def part(self, name: str) -> str:
        """The folder of a part; of "a|b" the first that is there."""
        names = name.split("|")
        return next((n for n in names if (self.path / n).is_dir()), names[0])

    def config(self, part: str) -> dict[str, Any]:
        """The configuration of a part.

        Raises:
            FileNotFoundError, ValueError: there is none, or it is no JSON object.
        """
        name = "scheduler_config.json" if part == "scheduler" else "config.json"
        content = read_json(self.path / self.part(part) / name)
        if not isinstance(content, dict):
            raise ValueError(f"{self.path / part / name}: expected a JSON object")
        return content

    def file(self, part: str) -> Path:
        """The file with the weights of a part.

        Raises:
            FileNotFoundError: there is none.
        """
        folder = self.path / self.part(part)
        for name in weight_names(part, self.variant):
            if (folder / name).is_file():
                return folder / name
        raise FileNotFoundError(f"{folder} has no {weight_names(part, self.variant)[0]}")


def weight_names(part: str, variant: str | None = None) -> list[str]:
    """Names that a part's weights may have, the best first: those of the variant, plain ones, fp16.

    A UNet of the variant is meant, and no other; parts beside it need not have one (averaged weights are the UNet's).
    """
    stem = STEMS.get(part.split("|")[0], "diffusion_pytorch_model")
    usual = [] if variant and part == "unet" else ["", ".fp16"]
    return list(dict.fromkeys(f"{stem}{v}.safetensors" for v in ([f".{variant}"] if variant else []) + usual))


def lacking(names: Iterable[str], parts: Iterable[str], variant: str | None = None) -> list[str]:
    """What a repository or folder with these files (as "part/name") lacks; empty if it has all that is needed."""
    present, missing = set(names), []
    for part in parts:
        if part.endswith("?"):
            continue
        here = [p for p in part.split("|") if any(name.startswith(f"{p}/") for name in present)]
        if not here:
            missing.append(f"{part.replace('|', '/ or ')}/")
            continue
        folder = here[0]
        if folder in WITHOUT_WEIGHTS:
            wanted = [WITHOUT_WEIGHTS[folder]]
        else:
            wanted = [("config.json",), tuple(weight_names(part, variant))]
        pickled = any(name.startswith(f"{folder}/") and name.endswith(".bin") for name in present)
        for either in wanted:
            if not any(f"{folder}/{name}" in present for name in either):
                missing.append(f"{folder}/{either[0]}" + " (only a pickle)" * (pickled and either[0] != "config.json"))
    return missing


def needed(names: Iterable[str], parts: Iterable[str], variant: str | None = None) -> list[str]:
    """Which files of a repository to download: every part's settings, and one file of weights each.

    Args:
        variant: as `Source.variant`; where it does not say, fp16 is preferred, which is half as large.
    """
    present, wanted = sorted(names), []
    for part in (p for either in parts for p in either.removesuffix("?").split("|")):
        wanted += [
            n for n in present if n.startswith(f"{part}/") and n.endswith((".json", ".txt")) and ".index" not in n
        ]
        order = weight_names(part, variant)
        order = order[:1] + order[:0:-1] if variant else order[::-1]
        wanted += [f"{part}/{n}" for n in order if part not in WITHOUT_WEIGHTS and f"{part}/{n}" in present][:1]
    return wanted


def cached(name: str, revision: str | None = None) -> Path | None:
    """The folder of a repository in the hub's cache, complete or not; None if it was never downloaded."""
    from huggingface_hub import constants

    folder = Path(constants.HF_HUB_CACHE) / f"models--{name.replace('/', '--')}"
    commit = revision or "main"
    reference = folder / "refs" / commit
    if reference.is_file():
        commit = reference.read_text(encoding="utf-8").strip()
    snapshot = folder / "snapshots" / commit
    return snapshot if snapshot.is_dir() else None


def locate(source: Source) -> Checkpoint | None:
    """The folder or file of a source, or None if it is not on this disk."""
    path = Path(source.place).expanduser()
    if path.exists():
        return Checkpoint(path, source.variant, source.trust_pickle)
    snapshot = cached(source.place, source.revision)
    if snapshot is None:
        return None
    return Checkpoint(snapshot, source.variant, source.trust_pickle, f"{source.place}@{snapshot.name}")


def find(prior: str, source: Source | None = None, parts: tuple[str, ...] | None = None) -> Checkpoint:
    """The weights of a prior: those that the user names, or the first that is complete of those that are known.

    A single file is returned as it is; whoever reads it checks what it holds.

    Args:
        parts: that are needed; None needs all of the prior's.

    Raises:
        ImportError: the extra is not installed.
        FileNotFoundError: there are none; it says what is missing where, and the command that gets it.
    """
    require_extra()
    known, tried = KNOWN[prior], []
    sources = [source] if source else [Source(r.id, r.revision, r.variant) for r in known.repositories]
    for candidate in sources:
        found = locate(candidate)
        if found is None:
            tried.append(f"{candidate}: not on this disk")
            continue
        missing = [] if found.path.is_file() else lacking(_listing(found.path), parts or known.parts, candidate.variant)
        if not missing:
            return found
        tried.append(f"{candidate}: {found.path} lacks {', '.join(missing)}")
    get = f"diff3ds fetch {prior}" + (f" --weights {source}" if source else "")
    raise FileNotFoundError(
        f"no weights for {prior}:\n  " + "\n  ".join(tried) + f"\nGet them ({known.download} GB): {get}\n"
        "or name a folder in the layout of diffusers, with safetensors, by --weights"
    )


def _listing(folder: Path) -> list[str]:
    return [f"{p.parent.name}/{p.name}" for p in folder.glob("*/*") if p.is_file()]


def require_extra(packages: Iterable[str] = EXTRA) -> None:
    """Raises ImportError if a package of the extra is not installed."""
    absent = [name for name in packages if importlib.util.find_spec(name) is None]
    if absent:
        raise ImportError(f'diffusion priors need {", ".join(absent)}: pip install "diff3ds[diffusion]"')
