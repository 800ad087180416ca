"""Fetching weights with the hub's own client from a server on this machine that breaks, lies and refuses."""

import random
import re
from pathlib import Path

import pytest
from huggingface_hub import close_session, constants
from local_hub import COMMIT, Hub, serve

from diff3ds.weights import download
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.fetch import Transfer, fetch, notice
from diff3ds.weights.judge_catalog import JUDGES
from diff3ds.weights.judge_files import find_folder
from diff3ds.weights.locate import find
from diff3ds.weights.weight_options import FetchOptions, Source

FIRST, SECOND, THIRD = (repository.id for repository in KNOWN["zero123"].repositories)
UNET = "unet/diffusion_pytorch_model.safetensors"
AVERAGED = UNET.replace("model.", "model.fp16_ema.")
PARTS = ("unet", "vae", "image_encoder", "clip_camera_projection", "scheduler")


def content(name, size=5000):
    return random.Random(name).randbytes(size)


def repository():
    """The files of a port, and others that nobody needs."""
    files = {f"{part}/config.json": b'{"part": "%s"}' % part.encode() for part in PARTS if part != "scheduler"}
    files |= {f"{part}/diffusion_pytorch_model.safetensors": content(part) for part in ("vae", PARTS[3])}
    files |= {UNET: content("unet", 3_000_000), "image_encoder/model.safetensors": content("image")}
    files |= {"scheduler/scheduler_config.json": b"{}", "unet/diffusion_pytorch_model.bin": content("pickle")}
    return files | {"README.md": b"read me", "safety_checker/model.safetensors": content("safety")}


@pytest.fixture
def hub(monkeypatch, tmp_path):
    with serve(Hub(files={FIRST: repository()})) as hub:
        monkeypatch.setattr(constants, "HF_HUB_OFFLINE", False)
        monkeypatch.setattr(constants, "ENDPOINT", hub.url)
        monkeypatch.setattr(
            constants, "HUGGINGFACE_CO_URL_TEMPLATE", hub.url + "/{repo_id}/resolve/{revision}/{filename}"
        )
        monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "cache"))
        monkeypatch.setattr(constants, "HF_HUB_DISABLE_IMPLICIT_TOKEN", True)
        monkeypatch.setattr(download, "PAUSE", 0.0)
        monkeypatch.setattr(download, "CHUNK", 100_000)
        yield hub
        close_session()


def test_only_needed_files_come_and_are_found_from_then_on(hub):
    transfers = []
    folder = fetch("zero123", report=transfers.append)
    found = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert found == repository().keys() - {
        "README.md",
        "safety_checker/model.safetensors",
        "unet/diffusion_pytorch_model.bin",
    }
    for name in found:
        assert (folder / name).read_bytes() == repository()[name]
    assert folder.name == COMMIT
    assert find("zero123").path == folder
    # Progress rises to the sum of all sizes.
    total = sum(len(repository()[name]) for name in found)
    done = [transfer.done for transfer in transfers]
    assert done == sorted(done)
    assert transfers[-1] == Transfer("", total, total)
    assert len([transfer for transfer in transfers if transfer.name == UNET]) > 5


def test_a_second_time_nothing_is_transferred(hub):
    fetch("zero123")
    hub.requests.clear()
    fetch("zero123")
    assert not [request for request in hub.requests if request[0] == "GET"]


def test_how_much_comes_from_where_is_said_before_it_comes(hub):
    """And which copies are gone; where some of it is here already, how much that is."""
    hub.files = {SECOND: repository()}
    hub.breaks[UNET] = [2_000_000] + [0] * download.ATTEMPTS
    said, gets = [], []

    def say(line):
        said.append(line)
        gets.append([request for request in hub.requests if request[0] == "GET"])

    with pytest.raises(ConnectionError):
        fetch("zero123", say=say)
    gone, offer = said
    assert gone == f"{FIRST}@main: not there, or private; trying {SECOND}@main"
    assert re.fullmatch(rf"from https://huggingface.co/{SECOND}, commit {COMMIT[:12]}: 3.0 MB; to \S+", offer)
    assert gets == [[], []]
    hub.breaks.clear()
    fetch("zero123", say=say)
    # The autoencoder, the projection and settings come behind the network.
    assert re.search(r": 3.0 MB, of which 2.0 MB are here; to ", said[-1])


def test_half_precision_is_preferred(hub):
    hub.files[FIRST]["unet/diffusion_pytorch_model.fp16.safetensors"] = content("half")
    folder = fetch("zero123")
    assert (folder / "unet/diffusion_pytorch_model.fp16.safetensors").exists()
    assert not (folder / UNET).exists()


def test_broken_connections_are_resumed(hub):
    hub.breaks[UNET] = [1_000_000, 500_000, 0, 0]
    folder = fetch("zero123")
    assert (folder / UNET).read_bytes() == repository()[UNET]
    # What came is kept: chunks that were complete when the connection broke.
    first, *starts = hub.gets(UNET)
    assert first is None
    starts = [int(wanted.removeprefix("bytes=").removesuffix("-")) for wanted in starts]
    assert starts == [1_000_000, 1_500_000, 1_500_000, 1_500_000]


def test_what_stays_broken_is_an_error_and_goes_on_next_time(hub):
    hub.breaks[UNET] = [2_000_000] + [0] * download.ATTEMPTS
    with pytest.raises(ConnectionError, match="broke after 2000000 of 3000000 bytes"):
        fetch("zero123")
    # Only this one: with a broken connection no other copy is tried.
    assert {name for _, name, _ in hub.requests} <= repository().keys()
    hub.breaks.clear()
    hub.requests.clear()
    folder = fetch("zero123")
    assert hub.gets(UNET) == ["bytes=2000000-"]
    assert (folder / UNET).read_bytes() == repository()[UNET]


def test_stopped_by_hand_it_goes_on(hub):
    def stop(transfer):
        if transfer.name == UNET and transfer.done > 1_500_000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch("zero123", report=stop)
    hub.requests.clear()
    fetch("zero123")
    ((start,),) = [[int(wanted[6:-1])] for wanted in hub.gets(UNET)]
    assert 1_400_000 < start < 1_700_000


def test_servers_without_ranges_send_all_again(hub):
    hub.ranges = False
    hub.breaks[UNET] = [1_000_000]
    assert (fetch("zero123") / UNET).read_bytes() == repository()[UNET]


def test_wrong_digest_is_not_kept(hub):
    hub.damaged[UNET] = 1
    with pytest.raises(ValueError, match=f"{UNET}: arrived damaged"):
        fetch("zero123")
    with pytest.raises(FileNotFoundError, match="no weights for zero123"):
        find("zero123")
    # Nothing damaged is gone on with.
    hub.requests.clear()
    assert (fetch("zero123") / UNET).read_bytes() == repository()[UNET]
    assert hub.gets(UNET) == [None]


def test_small_files_are_checked_too(hub):
    hub.damaged["unet/config.json"] = 1
    with pytest.raises(ValueError, match=r"unet/config\.json: arrived damaged"):
        fetch("zero123")


def test_damage_on_the_disk_is_found_and_mended(hub):
    folder = fetch("zero123")
    blob = (folder / UNET).resolve()
    blob.write_bytes(blob.read_bytes()[:-1] + b"?")
    assert (fetch("zero123") / UNET).read_bytes() == repository()[UNET]
    # Systems without links keep the file itself.
    (folder / UNET).unlink()
    blob.rename(folder / UNET)
    hub.requests.clear()
    fetch("zero123")
    assert hub.gets(UNET) == []
    (folder / UNET).write_bytes(b"short")
    assert (fetch("zero123") / UNET).read_bytes() == repository()[UNET]


def test_files_longer_than_announced_are_refused(hub, tmp_path):
    file = download.RemoteFile(f"{hub.url}/{FIRST}/resolve/main/{UNET}", "unet", 1000, 64 * "0")
    with pytest.raises(ValueError, match="unet: the server sent another size than the 1000 bytes"):
        download.download(file, tmp_path / "unet")
    assert list(tmp_path.iterdir()) == []


CLIP = "openai/clip-vit-base-patch32"
CLIP_FILES = {"config.json": b"{}", "model.safetensors": content("clip"), "vocab.json": b"{}", "merges.txt": b"m"}


def test_judges_are_fetched_with_their_tokenizer(hub):
    hub.files[CLIP] = CLIP_FILES | {"pytorch_model.bin": content("pickle"), "README.md": b"read me"}
    folder = fetch("clip-b32")
    assert {path.name for path in folder.iterdir()} == CLIP_FILES.keys()
    assert (folder / "model.safetensors").read_bytes() == content("clip")
    assert find_folder(CLIP, "CLIP") == folder
    hub.files["timm/vgg16.tv_in1k"] = CLIP_FILES
    assert [path.name for path in fetch("vgg16").iterdir()] == ["model.safetensors"]


def test_judges_with_pickles_only_come_from_a_pull_request(hub):
    """The hub that stands for the real one answers to every revision alike."""
    safe = hub.files.setdefault(CLIP, {"pytorch_model.bin": content("pickle")})
    with pytest.raises(ConnectionError) as caught:
        fetch("clip-b32")
    said = str(caught.value)
    assert f"  {CLIP}@main: lacks config.json, model.safetensors, tokenizer.json, which a revision refs/pr/N by" in said
    assert f"often has: --weights {CLIP}@refs/pr/N\n" in said
    assert said.endswith("or name a folder with --clip")
    safe |= CLIP_FILES
    folder = fetch("clip-b32", FetchOptions(f"{CLIP}@refs/pr/3"))
    assert find_folder(f"{CLIP}@refs/pr/3", "CLIP") == folder
    assert JUDGES["clip-b32"].found() == f"{CLIP}@{COMMIT}"


def test_copies_are_tried_in_their_order(hub):
    """The first is gone, the second gated, the third lacks the averaged weights, which are those of the others."""
    files = hub.files.pop(FIRST)
    hub.gated.add(SECOND)
    hub.files[THIRD] = files
    with pytest.raises(ConnectionError) as caught:
        fetch("zero123")
    reasons = str(caught.value).splitlines()
    assert reasons[0] == "no copy of the weights of zero123 can be had:"
    assert reasons[1] == f"  {FIRST}@main: not there, or private"
    assert reasons[2].startswith(f"  {SECOND}@main: accept its terms on https://huggingface.co/{SECOND}, then")
    assert reasons[3] == f"  {THIRD}@main: lacks {AVERAGED} (only a pickle)"
    hub.files[THIRD] = files | {AVERAGED: content("averaged")}
    folder = fetch("zero123")
    assert THIRD.replace("/", "--") in str(folder)
    assert (folder / AVERAGED).is_file()
    assert not (folder / UNET).exists()
    assert find("zero123").file("unet") == folder / AVERAGED


def test_a_repository_of_the_users(hub):
    hub.files["me/mine"] = hub.files.pop(FIRST)
    assert "me--mine" in str(fetch("zero123", FetchOptions("me/mine")))
    with pytest.raises(ConnectionError, match=r"(?s)you/yours: not there, or private.*name a folder with --weights"):
        fetch("zero123", FetchOptions("you/yours"))


@pytest.mark.parametrize("revision", ["refs/pr/1", COMMIT])
def test_another_layout_at_a_revision(hub, revision):
    """Some ports have safetensors only where a bot proposed them, and another name for the linear layer."""
    files = hub.files.pop(FIRST)
    hub.files["kxic/zero123-xl"] = {name.replace("clip_camera", "cc"): data for name, data in files.items()}
    place = f"kxic/zero123-xl@{revision}"
    folder = fetch("zero123", FetchOptions(place))
    assert (folder / "cc_projection/diffusion_pytorch_model.safetensors").read_bytes() == content(PARTS[3])
    assert find("zero123", Source.parse(place)).path == folder
    with pytest.raises(FileNotFoundError, match="kxic/zero123-xl: not on this disk"):
        find("zero123", Source.parse("kxic/zero123-xl"))


def test_a_full_disk_before_anything_comes(hub, monkeypatch):
    class Usage:
        free = 1_000_000

    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage)
    with pytest.raises(OSError, match=r"no room for the 0\.00 GB that are still to come.* Make room, or set HF_HOME"):
        fetch("zero123")
    assert not [request for request in hub.requests if request[0] == "GET"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_disk_that_fills_up(hub, tmp_path):
    """/dev/full takes nothing."""
    (tmp_path / "unet.part").symlink_to("/dev/full")
    file = download.RemoteFile(f"{hub.url}/{FIRST}/resolve/main/{UNET}", "unet", 3_000_000, 64 * "0")
    with pytest.raises(OSError, match=r"no room for the 0\.00 GB that are still to come"):
        download.download(file, tmp_path / "unet")
    assert not (tmp_path / "unet").exists()


def test_no_connection(hub, monkeypatch):
    monkeypatch.setattr(constants, "ENDPOINT", "http://127.0.0.1:9")
    with pytest.raises(ConnectionError, match=rf"(?s){FIRST}@main: no connection.*Without a connection: run the same"):
        fetch("zero123")


def test_offline_mode_is_named(hub, monkeypatch):
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    with pytest.raises(ConnectionError, match="HF_HUB_OFFLINE=1 forbids connections: unset it"):
        fetch("zero123")
    assert hub.requests == []


def test_bad_names(hub, tmp_path):
    with pytest.raises(ValueError, match=r"prior must be one of stable-diffusion, .* got 'dalle'"):
        fetch("dalle")
    with pytest.raises(ValueError, match=r"judge of clip-b16, .* got 'dalle'"):
        fetch("dalle")
    with pytest.raises(ValueError, match=r"alexnet is not on the hub. Get https://download.pytorch.org"):
        fetch("alexnet")
    with pytest.raises(ValueError, match="variant is for priors"):
        fetch("blip", FetchOptions(variant="fp16"))
    with pytest.raises(ValueError, match="is on this disk: nothing to fetch"):
        fetch("zero123", FetchOptions(str(tmp_path)))
    with pytest.raises(ValueError, match="weights must be a folder or file that exists or owner/name"):
        fetch("zero123", FetchOptions("no such thing"))


def test_licences_are_said():
    assert notice("zero123") == "zero123: licence of the weights: MIT (Zero123-XL, cvlab-columbia)."
    assert "non-commercial research only" in notice("stable-zero123")
    assert notice("blip") == "blip: licence of the weights: BSD-3-Clause."
    with pytest.raises(ValueError, match="prior must be one of"):
        notice("dalle")
