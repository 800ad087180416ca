"""Getting the weights of a prior or judge from the Hugging Face hub: what `diff3ds fetch` does."""

import re
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.filesize import decimal

from diff3ds.weights.catalog import KNOWN, Known
from diff3ds.weights.download import TIMEOUT, RemoteFile, begun, digest_of, disk_full, download, transport_error
from diff3ds.weights.judge_catalog import ELSEWHERE, JUDGES, Judge
from diff3ds.weights.locate import cached, lacking, needed, require_extra
from diff3ds.weights.weight_options import FetchOptions, Source

DIGEST = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
# Of the names of a repository's files: what it lacks, and which of them are needed.
Selection = Callable[[Iterable[str]], tuple[list[str], list[str]]]


@dataclass(frozen=True)
class Transfer:
    """How far a download is.

    Attributes:
        name: of the file that comes.
        done, total: bytes of all files, those included that were there before.
    """

    name: str
    done: int
    total: int


class UnavailableError(Exception):
    """A repository that cannot be had, or lacks what is needed; the next one may."""


def notice(name: str) -> str:
    """The licence of some weights, and what a user must know of it, to be shown before they are fetched or used.

    Raises:
        ValueError: no such prior or judge.
    """
    known = _known(name)
    warning = known.warning if isinstance(known, Known) else ""
    return f"{name}: licence of the weights: {known.licence}. {warning}".strip()


def fetch(
    name: str,
    options: FetchOptions | None = None,
    report: Callable[[Transfer], None] = lambda transfer: None,
    say: Callable[[str], None] = lambda line: None,
) -> Path:
    """Downloads the weights of a prior or judge into the hub's cache, where they are found from then on.

    Only the files that are needed: settings, and one file of safetensors for each part of a prior. Copies of
    the weights are tried in their order. A download that stopped goes on where it did. Every file is checked by its
    digest, also those that were there before.

    Args:
        name: of the prior or judge.
        options: default `FetchOptions()`.
        report: called as bytes arrive.
        say: told, before any byte of weights comes, from where, how much, and which copies are not to be had, and why.

    Returns:
        The folder of the weights.

    Raises:
        ImportError: the extra is not installed.
        ValueError: no such prior or judge; a source that is no repository; a file that arrived damaged.
        ConnectionError: no copy can be had, with the reason of each; a connection that broke.
        OSError: no room.
    """
    known, options = _known(name), options or FetchOptions()
    if isinstance(known, Judge) and options.variant:
        raise ValueError(f"variant is for priors: {name} has one file of weights")
    require_extra(("huggingface_hub",))
    sources, reasons = _sources(known, options), []
    for source in sources:
        try:
            return _fetch_from(source, _selection(known, source.variant), report, say)
        except UnavailableError as error:
            reasons.append(f"{source}: {error}")
            if source is not sources[-1]:
                say(f"{source}: {error}; trying {sources[len(reasons)]}")
    raise ConnectionError(
        f"no copy of the weights of {name} can be had:\n  " + "\n  ".join(reasons) + "\n"
        "Without a connection: run the same command on a machine that has one, copy its folder "
        f"{_cache() / _folder(sources[0].place)} to this machine, same place; or name a folder with "
        f"{known.option if isinstance(known, Judge) else '--weights'}"
    )


def _known(name: str) -> Known | Judge:
    if name in ELSEWHERE:
        url = ELSEWHERE[name].url
        raise ValueError(
            f"{name} is not on the hub. Get {url} and convert it, or allow it as it is (docs/howto/evaluate.md)"
        )
    if name not in KNOWN and name not in JUDGES:
        raise ValueError(f"prior must be one of {', '.join(KNOWN)}, or judge of {', '.join(JUDGES)}, got {name!r}")
    return KNOWN[name] if name in KNOWN else JUDGES[name]


def _selection(known: Known | Judge, variant: str | None) -> Selection:
    if isinstance(known, Judge):
        return known.select

    def select(names: Iterable[str]) -> tuple[list[str], list[str]]:
        there = set(names)
        return lacking(there, known.parts, variant), needed(there, known.parts, variant)

    return select


def _sources(known: Known | Judge, options: FetchOptions) -> list[Source]:
    if options.weights is None:
        return [Source(r.id, r.revision, options.variant or r.variant) for r in known.repositories]
    if Path(options.weights).expanduser().exists():
        raise ValueError(f"{options.weights} is on this disk: nothing to fetch")
    return [Source.parse(options.weights, options.variant)]


def _fetch_from(
    source: Source, select: Selection, report: Callable[[Transfer], None], say: Callable[[str], None]
) -> Path:
    commit, files = _files(source, select)
    store = _cache() / _folder(source.place)
    # A file of the cache is its blob, or, on systems without links, only the name that shows it.
    places = {name: (store / "blobs" / f.digest, store / "snapshots" / commit / name) for name, f in files.items()}
    for name, file in files.items():
        _drop_damaged(places[name], file.digest)
    missing = {name: file for name, file in files.items() if not any(place.exists() for place in places[name])}
    total, coming = sum(file.size for file in files.values()), _coming(store / "blobs", missing.values())
    here = f", of which {decimal(total - coming)} are here" if coming < total else ""
    say(f"from https://huggingface.co/{source.place}, commit {commit[:12]}: {decimal(total)}{here}; to {store}")
    _require_room(store / "blobs", coming)
    before = total - sum(file.size for file in missing.values())
    for name, file in missing.items():

        def received(done: int, name: str = name, before: int = before) -> None:
            report(Transfer(name, before + done, total))

        with _unavailable(source):
            download(file, places[name][0], received)
        before += file.size
    report(Transfer("", total, total))
    return _linked(source, list(files), select)


def _drop_damaged(places: tuple[Path, Path], digest: str) -> None:
    if any(place.exists() and digest_of(place, digest) != digest for place in places):
        for place in places:
            place.unlink(missing_ok=True)


def _files(source: Source, select: Selection) -> tuple[str, dict[str, RemoteFile]]:
    """The commit of a repository, and its files that are needed, by their path in it."""
    from huggingface_hub import HfApi, hf_hub_url

    with _unavailable(source):
        info = HfApi().model_info(source.place, revision=source.revision, files_metadata=True, timeout=TIMEOUT)
    there = {file.rfilename: file for file in info.siblings or []}
    missing, wanted = select(there)
    if missing:
        raise UnavailableError(f"lacks {', '.join(missing)}")
    files = {}
    for name in wanted:
        size, large = there[name].size, there[name].lfs
        digest = large.sha256 if large else there[name].blob_id
        if size is None or digest is None or not DIGEST.fullmatch(digest):
            raise UnavailableError(f"says no size or digest of {name}")
        url = hf_hub_url(source.place, name, revision=info.sha or source.revision)
        files[name] = RemoteFile(url, f"{source.place}/{name}", size, digest)
    return info.sha or "", files


def _linked(source: Source, names: list[str], select: Selection) -> Path:
    """The folder in the cache that shows downloaded files under their names."""
    from huggingface_hub import hf_hub_download

    with _unavailable(source):
        for name in names:
            hf_hub_download(source.place, name, revision=source.revision, etag_timeout=TIMEOUT)
    folder = cached(source.place, source.revision)
    if folder is None or select(n for n in names if (folder / n).is_file())[0]:
        raise UnavailableError("changed while it was downloaded: run the same command again")
    return folder


def _coming(blobs: Path, files: Collection[RemoteFile]) -> int:
    """Bytes that are still to come."""
    return sum(file.size - begun(blobs / file.digest) for file in files)


def _require_room(blobs: Path, coming: int) -> None:
    there = next(folder for folder in (blobs, *blobs.parents) if folder.exists())
    if shutil.disk_usage(there).free < coming:
        raise disk_full(there, coming)


@contextmanager
def _unavailable(source: Source) -> Iterator[None]:
    """Turns what a server says, or that it cannot be reached, into a reason to try the next copy."""
    from huggingface_hub import errors

    try:
        yield
    except errors.OfflineModeIsEnabled as error:
        raise UnavailableError("HF_HUB_OFFLINE=1 forbids connections: unset it") from error
    except errors.GatedRepoError as error:
        page = f"https://huggingface.co/{source.place}"
        raise UnavailableError(f"accept its terms on {page}, then run: hf auth login") from error
    except errors.HfHubHTTPError as error:
        gone = "not there, or private" if error.response.status_code in (401, 404) else str(error).splitlines()[0]
        raise UnavailableError(gone) from error
    except (transport_error(), errors.LocalEntryNotFoundError) as error:
        raise UnavailableError(f"no connection ({str(error).splitlines()[0] if str(error) else error!r})") from error


def _cache() -> Path:
    from huggingface_hub import constants

    return Path(constants.HF_HUB_CACHE)


def _folder(name: str) -> str:
    return f"models--{name.replace('/', '--')}"
