"""Readers on broken and hostile files: a sketch or a mesh, or a ValueError that names the file, in bounded time.

Seeded: what fails can be made again. Every format that `ds.load` and `ds.load_surface` read takes part.
"""

import importlib.util
import json
import random
import struct
import warnings

import examples_of_meshes
import numpy as np
import pytest
import torch
from examples_of_curves import EXAMPLES
from hostile import broken

import diff3ds as ds
from diff3ds.formats import load_dxf
from diff3ds.formats.mesh import MESHES, UP_IS_KNOWN, read_mesh

# Damaged files of each format in the slow test, some ten seconds each: a STEP file takes a second to be read.
MANY = {".json": 5000, ".step": 15, ".dxf": 50, ".3dm": 80, ".usda": 40, ".usdc": 40}
PACKAGES = {".json": "json", ".step": "OCP", ".dxf": "ezdxf", ".3dm": "rhino3dm", ".usda": "pxr", ".usdc": "pxr"}
FORMATS = [
    pytest.param(
        suffix,
        marks=pytest.mark.skipif(importlib.util.find_spec(package) is None, reason=f"{package} is not installed"),
    )
    for suffix, package in PACKAGES.items()
]


def sketch():
    g = torch.Generator().manual_seed(0)
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, (1.0, 2.0, 3.0))
    ring = ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], True))
    free = ds.Sketch(torch.rand(3, 4, 3, generator=g).double(), 0.5 + torch.rand(3, 4, generator=g).double())
    return ds.Sketch.concatenate([ring, free])


def good_files(folder, suffix):
    """A file of ours, and of the tables of what is read those that have a feature each."""
    ds.save(folder / f"ours{suffix}", sketch())
    files = [(folder / f"ours{suffix}").read_bytes()]
    for format_, examples in EXAMPLES.items():
        for number, example in enumerate(examples.values() if f"`{suffix}`" in format_ else ()):
            (folder / str(number)).mkdir()
            made = example.make(folder / str(number))
            files += [made.read_bytes()] if made.suffix == suffix else []
    return files


def check_fuzzed(folder, suffix, count, seed):
    """Of so many damaged files; returns how many were read all the same."""
    path, rng = folder / f"some file{suffix}", random.Random(seed)
    good = good_files(folder, suffix)
    said = []
    for _ in range(count):
        path.write_bytes(broken(rng.choice(good), rng))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                ds.load(path).check_values()
        except ValueError as error:
            said.append(str(error))
    assert [text for text in said if f"some file{suffix}" not in text] == []
    return count - len(said)


def mesh_seeds(folder, suffix):
    """The examples of the tables that are files of this format and can be read, each in a folder of its own."""
    seeds = []
    for k, example in enumerate(e for of in examples_of_meshes.EXAMPLES.values() for e in of.values()):
        inner = folder / f"seed {k}"
        inner.mkdir()
        path = example.make(inner)
        try:
            examples_of_meshes.read(path)
        except ValueError:
            continue
        if path.suffix == suffix:
            seeds.append((path.with_name(f"some file{suffix}"), path.read_bytes()))
    return seeds


# What may stand in JSON where something else should.
STRANGE = [
    "null",
    "true",
    "-1",
    "1e308",
    "2147483647",
    "9223372036854775808",
    "0.5",
    '"x"',
    "[]",
    "{}",
    "[[]]",
    "[1, 2, 3]",
]


def broken_gltf(good, rng):
    """A glTF file, binary or not, of which some values are others, or missing, and which is whole otherwise."""
    binary = good[:4] == b"glTF"
    size = struct.unpack_from("<I", good, 12)[0] if binary else len(good)
    text, rest = (good[20 : 20 + size], good[20 + size :]) if binary else (good, b"")
    content = json.loads(text)
    for _ in range(rng.choice([1, 1, 2, 5])):
        places, ways = [], [content]
        while ways:
            thing = ways.pop()
            keys = list(thing) if isinstance(thing, dict) else range(len(thing))
            places += [(thing, key) for key in keys]
            ways += [thing[key] for key in keys if isinstance(thing[key], dict | list)]
        thing, key = rng.choice(places)
        if rng.random() < 0.2:
            del thing[key]
        else:
            thing[key] = json.loads(rng.choice([*STRANGE, str(rng.randrange(12))]))
        if not content:
            break
    text = json.dumps(content).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<IIII", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def check_fuzzed_meshes(folder, suffix, count, seed):
    """As `check_fuzzed`: what is read are triangles between places, with colours or none."""
    rng, said = random.Random(seed), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        seeds = mesh_seeds(folder, suffix)
        for _ in range(count):
            path, good = rng.choice(seeds)
            gltf = suffix in UP_IS_KNOWN and rng.random() < 0.7
            path.write_bytes(broken_gltf(good, rng) if gltf else broken(good, rng))
            try:
                found = read_mesh(path, colors=True)
            except ValueError as error:
                said.append(str(error))
                continue
            corners = found.vertices[found.faces]
            assert corners.shape == (len(found.polygon), 3, 3)
            assert np.isfinite(corners).all()
            shades = found.colors.at(np.arange(len(corners)), np.full((len(corners), 3), 1 / 3))
            assert np.isnan(shades[~found.colors.known]).all()
            assert ((shades[found.colors.known] >= 0) & (shades[found.colors.known] <= 1)).all()
    # Types are checked in tests alone: elsewhere what they say would go on.
    assert [text[:300] for text in said if f"some file{suffix}" not in text or "Type-check" in text] == []
    return count - len(said)


@pytest.mark.parametrize("suffix", MESHES)
def test_damaged_meshes_give_a_mesh_or_an_error_that_names_the_file(tmp_path, suffix):
    check_fuzzed_meshes(tmp_path, suffix, 100, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", MESHES)
def test_many_damaged_meshes(tmp_path, suffix):
    assert 0 < check_fuzzed_meshes(tmp_path, suffix, 2000, seed=1) < 2000


@pytest.mark.parametrize("suffix", FORMATS)
def test_damaged_files_give_a_sketch_or_an_error_that_names_the_file(tmp_path, suffix):
    # With a seed of 0 rhino3dm goes on for the half minute that it is given.
    check_fuzzed(tmp_path, suffix, 300 if suffix == ".json" else 1, seed=3)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", FORMATS)
def test_many_damaged_files(tmp_path, suffix):
    assert 0 < check_fuzzed(tmp_path, suffix, MANY[suffix], seed=1) < MANY[suffix]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("points", "[[[1, 2, 1e999]]]"),
        ("points", "[" * 100_000),
        ("points", "[[[1, 2, 3], [1, 2]]]"),
        ("segments", "[99999999999999999999]"),
        ("segments", "[-1]"),
        ("segments", "[1e18]"),
        ("width", "[" + "9" * 10_000 + "]"),
        ("dtype", '"float8192"'),
        ("version", "1e999"),
    ],
)
def test_hostile_numbers_in_json(tmp_path, key, value):
    values = {"version": "2", "points": "[[[0, 0, 0], [1, 1, 1]]]", "weights": "[[1, 1]]", "width": "[1]"}
    values |= {
        "color": "[[0, 0, 0]]",
        "opacity": "[1]",
        "width_space": '"image"',
        "segments": "[1]",
        "closed": "[false]",
    }
    values[key] = value
    (tmp_path / "a.json").write_text("{" + ",".join(f'"{k}": {v}' for k, v in values.items()) + "}")
    with pytest.raises(ValueError, match=r"a\.json"):
        ds.load(tmp_path / "a.json")


@pytest.mark.skipif(importlib.util.find_spec("ezdxf") is None, reason="the extra cad is not installed")
def test_blocks_in_blocks_do_not_explode(tmp_path):
    import ezdxf

    document = ezdxf.new("R2010")
    document.blocks.new("b0").add_line((0, 0), (1, 1))
    for i in range(1, 30):
        block = document.blocks.new(f"b{i}")
        for _ in range(10):
            block.add_blockref(f"b{i - 1}", (0, 0))
    document.modelspace().add_blockref("b29", (0, 0))
    document.saveas(tmp_path / "a.dxf")
    with pytest.raises(ValueError, match="blocks more than 16 deep"):
        load_dxf(tmp_path / "a.dxf")


# A STEP file takes a second to be read.
@pytest.mark.parametrize(
    "suffix", [FORMATS[0], *FORMATS[2:], pytest.param(".step", marks=[*FORMATS[1].marks, pytest.mark.slow])]
)
def test_names_with_spaces_and_other_letters(tmp_path, suffix):
    path = tmp_path / "ein Möbiusband 漢字 😀" / f"it's (1) ü{suffix}"
    ds.save(path, sketch())
    assert len(ds.load(path)) == 4
