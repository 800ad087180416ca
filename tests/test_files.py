"""Files are written whole or not at all, and read within bounds."""

import errno
import os
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file

import diff3ds as ds
from diff3ds import _files, _tensor_files, formats


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    _files.write_text(path, "old")

    def fail() -> None:
        with _files.replacing(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with _files.replacing(path) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".bin"
        temporary.write_bytes(b"new")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def full(*arguments: object) -> None:
    """What safetensors says on a disk without room (0.8.0)."""
    raise SafetensorError("Error while serializing: I/O error: No space left on device (os error 28)")


def test_a_disk_that_fills_up_is_an_oserror_that_says_what_to_do(tmp_path, monkeypatch):
    path = tmp_path / "a.safetensors"
    _tensor_files.write_tensors(path, {"a": torch.ones(3)}, {"about": "1"})
    monkeypatch.setattr("safetensors.torch.save_file", full)
    with pytest.raises(OSError, match=r"make room.*--resume") as raised:
        _tensor_files.write_tensors(path, {"a": torch.zeros(3)}, {"about": "2"})
    assert raised.value.errno == errno.ENOSPC
    assert raised.value.filename == str(path)
    assert load_file(path)["a"].tolist() == [1, 1, 1]
    assert list(tmp_path.iterdir()) == [path]


def test_other_failures_to_write_tensors_are_oserrors_too(tmp_path, monkeypatch):
    def fail(*arguments: object) -> None:
        raise SafetensorError("Error while serializing: I/O error: Input/output error (os error 5)")

    monkeypatch.setattr("safetensors.torch.save_file", fail)
    with pytest.raises(OSError, match="Input/output error") as raised:
        _tensor_files.write_tensors(tmp_path / "a.safetensors", {}, {})
    assert raised.value.errno == errno.EIO


def test_folders_are_made(tmp_path):
    _files.write_bytes(tmp_path / "a" / "b" / "c.bin", b"x")
    assert (tmp_path / "a" / "b" / "c.bin").read_bytes() == b"x"


def test_new_files_have_the_rights_of_new_files(tmp_path):
    _files.write_text(tmp_path / "ours", "x")
    (tmp_path / "plain").write_text("x")
    assert os.stat(tmp_path / "ours").st_mode == os.stat(tmp_path / "plain").st_mode


def test_threads_leave_the_umask_alone(tmp_path, monkeypatch):
    """It belongs to the process: asked for by two threads at once, it can stay what one of them set it to."""
    monkeypatch.setattr(os, "umask", None)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: _files.write_text(tmp_path / str(k), "x"), range(64)))
    (tmp_path / "plain").write_text("x")
    assert {path.stat().st_mode for path in tmp_path.iterdir()} == {(tmp_path / "plain").stat().st_mode}


def test_errors_name_the_file(tmp_path):
    path = tmp_path / "a.json"
    with pytest.raises(FileNotFoundError, match=r"a\.json"):
        _files.read_json(path)
    path.write_bytes(b"\xff")
    with pytest.raises(ValueError, match=r"a\.json: not a text file"):
        _files.read_json(path)
    path.write_text("{")
    with pytest.raises(ValueError, match=r"a\.json: not a JSON file"):
        _files.read_json(path)
    path.write_text('{"é": [1, 2.5, null]}', encoding="utf-8")
    assert _files.read_json(path) == {"é": [1, 2.5, None]}


@pytest.mark.parametrize(
    ("read", "name", "wanted"),
    [
        (ds.load, "no.json", "give the folder of a run, or a file with a sketch"),
        (ds.load, "no.step", "give the folder of a run, or a file with a sketch"),
        (ds.load_surface, "no.stl", "give a mesh, a file such as part.stl"),
        (ds.load_surface, "no.step", "give solids, a file such as part.step"),
        (ds.load_surface, "no.igs", "give solids, a file such as part.step"),
        (ds.mesh_to_sketch, "no.obj", "give a mesh, a file such as part.stl"),
        (ds.points_to_sketch, "no.ply", "give a cloud of points, a file such as scan.ply"),
        (ds.load_transforms, "no.json", "give a file that is"),
        (formats.load_dxf, "no.dxf", "give a file that is"),
        (ds.recognise, "no.png", "give a picture of one object"),
    ],
)
def test_a_file_that_is_missing_is_told_with_what_to_give(read, name, wanted, tmp_path):
    with pytest.raises(FileNotFoundError) as told:
        read(tmp_path / name)
    assert str(told.value).startswith(f"{tmp_path / name} is not there: {wanted}")


@pytest.mark.parametrize("suffix", [".stl", ".step", ".ply"])
def test_a_folder_is_no_file(suffix, tmp_path):
    (tmp_path / f"a{suffix}").mkdir()
    for read in (ds.load_surface, ds.points_to_sketch if suffix == ".ply" else ds.mesh_to_sketch):
        with pytest.raises(IsADirectoryError, match="is a folder: give "):
            read(tmp_path / f"a{suffix}")
