"""Files are written whole or not at all, and read within bounds."""

import os

import pytest

from diff3ds import _files


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


def test_folders_are_made(tmp_path):
    _files.write_bytes(tmp_path / "a" / "b" / "c.bin", b"x")
    assert (tmp_path / "a" / "b" / "c.bin").read_bytes() == b"x"


def test_new_files_have_the_rights_of_new_files(tmp_path):
    _files.write_text(tmp_path / "ours", "x")
    (tmp_path / "plain").write_text("x")
    assert os.stat(tmp_path / "ours").st_mode == os.stat(tmp_path / "plain").st_mode


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
