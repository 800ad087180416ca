"""Where the weights of the networks that judge sketches are published, and which of them are on this disk."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from diff3ds.weights.catalog import Repository
from diff3ds.weights.locate import cached

# What a model of transformers needs ("a|b" is either), and what is fetched with it where it is there.
MODEL = ("config.json", "model.safetensors", "tokenizer.json|vocab.json|vocab.txt")
TOKENIZER = (
    "tokenizer_config.json",
    "special_tokens_map.json",
    "tokenizer.json",
    "vocab.json",
    "merges.txt",
    "vocab.txt",
)
# Of a repository that has pickles only.
HINT = "which a revision refs/pr/N by SFconvertbot often has: --weights {}@refs/pr/N"


@dataclass(frozen=True)
class Judge:
    """What is known about the weights of a network that judges.

    Attributes:
        option: of `diff3ds eval` or `diff3ds views --recipe 3doodle` that takes them.
        repositories: of the Hugging Face hub that have them, the best first.
        files: of a repository that are needed.
        download: gigabytes.
        licence: of the weights.
    """

    option: str
    repositories: tuple[Repository, ...]
    files: tuple[str, ...]
    download: float
    licence: str

    def select(self, names: Iterable[str]) -> tuple[list[str], list[str]]:
        """Of the names of a repository's files: what it lacks, and which of them are needed."""
        there = set(names)
        missing = [file.split("|")[0] for file in self.files if not there & set(file.split("|"))]
        if missing and any(name.endswith(".bin") for name in there):
            missing.append(HINT.format(self.repositories[0].id))
        wanted = {name for file in self.files for name in file.split("|")}
        return missing, sorted(there & (wanted | set(TOKENIZER) if self.files == MODEL else wanted))

    def found(self) -> str | None:
        """What to give the option: the repository, with the commit if its main branch is not here; None if none is."""
        for repository in self.repositories:
            for place in (repository.id, *(f"{repository.id}@{commit}" for commit in _commits(repository.id))):
                folder = cached(*place.split("@"))
                if folder is not None and not self.select(path.name for path in folder.iterdir())[0]:
                    return place
        return None


@dataclass(frozen=True)
class Elsewhere:
    """Weights that are not on the hub, and nowhere but as pickles.

    Attributes:
        option: as of `Judge`.
        url: of the file.
        licence: of the weights.
    """

    option: str
    url: str
    licence: str

    def found(self) -> str | None:
        """The file where torchvision keeps what it downloads; None if it is not there."""
        import torch

        path = Path(torch.hub.get_dir()) / "checkpoints" / self.url.rpartition("/")[2]
        return str(path) if path.is_file() else None


JUDGES: dict[str, Judge] = {
    "clip-b16": Judge("--clip", (Repository("openai/clip-vit-base-patch16"),), MODEL, 0.6, "MIT"),
    "clip-b32": Judge("--clip", (Repository("openai/clip-vit-base-patch32"),), MODEL, 0.6, "MIT"),
    "blip": Judge("--blip", (Repository("Salesforce/blip-itm-large-coco"),), MODEL, 1.8, "BSD-3-Clause"),
    "vgg16": Judge("--vgg16", (Repository("timm/vgg16.tv_in1k"),), ("model.safetensors",), 0.55, "BSD-3-Clause"),
    "clip-rn101": Judge(
        "--clip-rn101", (Repository("timm/resnet101_clip.openai"),), ("open_clip_model.safetensors",), 0.48, "MIT"
    ),
}
LPIPS = "https://raw.githubusercontent.com/richzhang/PerceptualSimilarity/master/lpips/weights/v0.1"
ELSEWHERE: dict[str, Elsewhere] = {
    "alexnet": Elsewhere("--alexnet", "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth", "BSD-3-Clause"),
    "lpips-alex": Elsewhere("--lpips-alex", f"{LPIPS}/alex.pth", "BSD-2-Clause"),
    "lpips-vgg": Elsewhere("--lpips-vgg", f"{LPIPS}/vgg.pth", "BSD-2-Clause"),
}


def _commits(repository: str) -> list[str]:
    """Commits of a repository of which something is in the hub's cache."""
    from huggingface_hub import constants

    snapshots = Path(constants.HF_HUB_CACHE) / f"models--{repository.replace('/', '--')}" / "snapshots"
    return sorted(path.name for path in snapshots.glob("*"))
