"""Readers of cameras on broken and hostile files: views or an error that names a file of the project, in bounded time.

Seeded: what fails can be made again. Every program whose files are read takes part.
"""

import random
import warnings

import pytest
from hostile import broken
from written_projects import CAMERAS, KINDS, NAMES, colmap_binary, pictures

import diff3ds as ds
from diff3ds.photogrammetry.find_project import find_project, present_views, sparse_points

# Damaged files of each program: of the quick test, of the slow one.
FEW, MANY = 60, 1000


def write_binary(folder):
    colmap_binary(folder / "sparse" / "0")
    pictures(folder / "images")


def write_transforms(folder):
    ds.save_transforms(folder / "transforms.json", CAMERAS, [f"images/{name}" for name in NAMES])
    pictures(folder / "images")


PROJECTS = {**KINDS, "colmap binary": write_binary, "transforms": write_transforms}


@pytest.mark.parametrize("name", ["a" * 5000, "/".join(["a" * 300] * 9), "a\0b"])
def test_names_that_no_file_can_have(tmp_path, name):
    for kind, edit in {"transforms": f"images/{NAMES[1]}", "colmap": NAMES[1]}.items():
        (tmp_path / kind).mkdir()
        PROJECTS[kind](tmp_path / kind)
        file = next(f for f in (tmp_path / kind).rglob("*") if f.name in ("transforms.json", "images.txt"))
        file.write_text(file.read_text().replace(edit, name.replace("\0", "\\u0000") if kind == "transforms" else name))
        with pytest.warns(UserWarning, match="1 of 4 pictures are missing"):
            assert len(present_views(find_project(tmp_path / kind))) == 3


def check_fuzzed(folder, kind, count, seed):
    """Of so many projects with one damaged file; returns how many were read all the same."""
    PROJECTS[kind](folder)
    files = sorted(f for f in folder.rglob("*") if f.is_file() and f.suffix != ".png")
    good, rng, read = {file: file.read_bytes() for file in files}, random.Random(seed), 0
    said = []
    for _ in range(count):
        file = rng.choice(files)
        file.write_bytes(broken(good[file], rng))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = find_project(folder)
                views, points = present_views(found), sparse_points(found)
            assert len(views) >= 1
            assert all(bool(view.world_to_camera.isfinite().all()) for view in views)
            assert bool((points * points).isfinite().all())
            read += 1
        except (ValueError, FileNotFoundError) as error:
            said.append(str(error))
        file.write_bytes(good[file])
    assert [text for text in said if str(folder) not in text] == []
    return read


@pytest.mark.parametrize("kind", PROJECTS)
def test_damaged_projects_give_views_or_an_error_that_names_a_file(tmp_path, kind):
    check_fuzzed(tmp_path, kind, FEW, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", PROJECTS)
def test_many_damaged_projects(tmp_path, kind):
    assert 0 < check_fuzzed(tmp_path, kind, MANY, seed=1) < MANY
