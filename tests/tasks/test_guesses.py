"""`ds.recognise` and `diff3ds image --guess`: pictures of the library, drawings as people draw, and bad input."""

import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image, ImageDraw

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.library import CATEGORIES, member
from diff3ds.recognition.network import AZIMUTHS, ELEVATIONS, SIZE, SOURCE, WEIGHTS, trained
from diff3ds.tasks.text_image.guess_sheet import SIDE, WORDS

# By hand: a house, a mug and a table from the front, corners of lines in a box of 100.
HOUSE = ["10 90 10 45 50 10 90 45 90 90 10 90", "10 45 90 45", "42 90 42 65 58 65 58 90"]
MUG = ["20 20 20 85 65 85 65 20 20 20", "65 32 85 34 88 55 82 68 65 70"]
LADDER = ["30 5 30 95", "65 5 65 95", "30 20 65 20", "30 36 65 36", "30 52 65 52", "30 68 65 68", "30 84 65 84"]
CAT = ["30 40 28 15 42 28 58 28 72 15 70 40 66 58 50 66 34 58 30 40", "40 42 42 42", "58 42 60 42", "46 54 50 56 54 54",
       "32 50 12 46", "32 54 12 56", "68 50 88 46", "68 54 88 56"]  # fmt: skip


def by_hand(strokes, size=300) -> np.ndarray:
    image = Image.new("L", (size, size), 255)
    for stroke in strokes:
        ImageDraw.Draw(image).line(
            [float(v) * size / 100 for v in stroke.split()], 0, max(2, size // 75), joint="curve"
        )
    return np.asarray(image)


def pictured(path: Path, kind: str, azimuth=40.0, elevation=20.0) -> Path:
    sketch = member(kind, torch.Generator().manual_seed(1001)).sketch
    save_png(path, ds.render(sketch, ds.orbit(azimuth, elevation, 1.9, size=256)).color[0])
    return path


@pytest.mark.parametrize(
    "kind",
    [
        "chair",
        pytest.param("hot-air balloon", marks=pytest.mark.slow),
        pytest.param("bicycle", marks=pytest.mark.slow),
        pytest.param("teapot", marks=pytest.mark.slow),
    ],
)
def test_pictures_of_the_library(kind, tmp_path):
    found = ds.recognise(pictured(tmp_path / "a.png", kind))
    first = found.guesses[0]
    assert found.taken
    assert first.kind == kind
    assert 0.5 < first.confidence < 1
    assert len({guess.kind for guess in found.guesses}) == 3
    assert sum(guess.confidence for guess in found.guesses) <= 1
    assert [guess.confidence for guess in found.guesses] == sorted((g.confidence for g in found.guesses), reverse=True)


@pytest.mark.slow
def test_the_side_that_one_sees(tmp_path):
    """A bicycle and a teapot have no sides that look alike, but for left and right."""
    for kind, azimuth in (("chair", 40.0), ("teapot", 70.0), ("teapot", 290.0)):
        first = ds.recognise(pictured(tmp_path / "a.png", kind, azimuth, 15.0)).guesses[0]
        assert first.kind == kind
        assert abs(first.azimuth - azimuth) <= 15
        assert abs(first.elevation - 15) <= 15


@pytest.mark.parametrize(("strokes", "kind"), [(HOUSE, "house"), (MUG, "mug"), (LADDER, "ladder")])
def test_drawings_by_hand(strokes, kind):
    found = ds.recognise(by_hand(strokes))
    assert found.taken
    assert found.guesses[0].kind == kind


@pytest.mark.slow
def test_what_is_no_kind_is_not_taken():
    for strokes in (CAT, ["10 10 90 90"], ["10 90 50 10 90 90", "28 55 72 55"], ["20 20 80 20 80 80 20 80 20 20"]):
        found = ds.recognise(by_hand(strokes))
        assert not found.taken
        assert len(found.guesses) == 3


def test_a_path_and_all_kinds_of_arrays_are_the_same_picture(tmp_path, monkeypatch):
    """The same lines, to the last bit, are asked about."""
    gray = by_hand(HOUSE)
    Image.fromarray(gray).save(tmp_path / "a.png")
    assert ds.recognise(gray > 127).guesses[0].kind == "house"
    monkeypatch.setattr("diff3ds.recognition.recognise.recognise", lambda lines: lines)
    expected = ds.recognise(tmp_path / "a.png")
    color = np.repeat(gray[..., None], 3, 2)
    alpha = np.concatenate([color, np.full_like(gray, 255)[..., None]], 2)
    pictures = [str(tmp_path / "a.png"), gray, gray[..., None], color, alpha, torch.from_numpy(color.copy()),
                gray / 255, torch.from_numpy(gray / 255).requires_grad_()]  # fmt: skip
    for picture in pictures:
        lines = ds.recognise(picture)
        assert lines.kind == expected.kind
        for name in ("points", "tangents", "colors"):
            np.testing.assert_array_equal(getattr(lines, name), getattr(expected, name))


def test_the_same_for_any_number_of_threads():
    before, found = torch.get_num_threads(), []
    for threads in (1, 3):
        torch.set_num_threads(threads)
        found.append(ds.recognise(by_hand(MUG)))
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("picture", "error", "message"),
    [
        (np.full((200, 200), 255, np.uint8), ValueError, "no object to make a sketch of"),
        (
            np.pad(by_hand(HOUSE, 30), 9, constant_values=255),
            ValueError,
            "give a picture in which its longer side has 32 or more",
        ),
        (np.broadcast_to(np.uint8(0), (1 << 14, 1 << 14)), ValueError, r"too large: 2\^27"),
        (np.zeros((40, 40, 2), np.uint8), ValueError, r"cannot have the shape \(40, 40, 2\)"),
        (np.zeros((0, 40), np.uint8), ValueError, r"cannot have the shape \(0, 40\)"),
        (np.zeros((4, 40, 40, 3), np.uint8), ValueError, "cannot have the shape"),
        (np.zeros((40, 40), np.int64), ValueError, "int64 does not say what is white"),
        (np.full((40, 40), 255.0), ValueError, "from 0 to 1, got 255 to 255"),
        (np.full((40, 40), np.nan), ValueError, "from 0 to 1, got nan to nan"),
        (17, TypeError, "the path of a file or an array, got int"),
        (None, TypeError, "got NoneType"),
        ("nowhere.png", FileNotFoundError, "nowhere.png is not there"),
    ],
)
def test_what_is_no_picture(picture, error, message):
    with pytest.raises(error, match=message):
        ds.recognise(picture)


@pytest.mark.slow
def test_a_mask_and_a_background(tmp_path):
    picture = np.repeat(by_hand(HOUSE)[..., None], 3, 2)
    crowded = picture.copy()
    crowded[:, :40] = np.random.default_rng(0).integers(0, 255, (300, 40, 3))
    mask = np.full((300, 300), 255, np.uint8)
    Image.fromarray(mask).save(tmp_path / "mask.png")
    assert ds.recognise(picture, mask=tmp_path / "mask.png").guesses[0].kind == "house"
    assert ds.recognise(picture, background="white") == ds.recognise(picture)
    with pytest.raises(ValueError, match="either a mask or a background"):
        ds.recognise(picture, mask=tmp_path / "mask.png", background="white")


def test_guesses_are_printed_and_nothing_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = pictured(tmp_path / "chair.png", "chair")
    main(["image", str(path), "--guess"])
    said = capsys.readouterr().out
    found = ds.recognise(path)
    assert said == f"{found}\nthe first is sure enough to be drawn\n"
    assert said.startswith("1. a chair (9")
    assert said.count("--shows") == 3
    Image.fromarray(by_hand(CAT)).save(tmp_path / "cat.png")
    main(["image", "cat.png", "--guess"])
    assert capsys.readouterr().out.endswith("none is sure enough to be drawn\n")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cat.png", "chair.png"]


def test_guesses_are_shown_beside_each_other(tmp_path, capsys):
    """The sheet has the three small pictures, in order, with words under them."""
    found = ds.recognise(by_hand(CAT))
    Image.fromarray(by_hand(CAT)).save(tmp_path / "cat.png")
    main(["image", str(tmp_path / "cat.png"), "--guess", "-o", str(tmp_path / "out")])
    assert capsys.readouterr().out.endswith(f"their pictures: {tmp_path / 'out' / 'guesses.png'}\n")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["guesses.png"]
    shown = np.asarray(Image.open(tmp_path / "out" / "guesses.png"), float) / 255
    assert shown.shape == (SIDE + WORDS, 3 * SIDE)
    for i, guess in enumerate(found.guesses):
        camera = ds.orbit(guess.azimuth, guess.elevation, 1.9, size=SIDE)
        chosen = member(guess.kind, torch.Generator().manual_seed(0), guess.attributes).sketch
        picture = ds.render(chosen, camera).color[0, ..., 0].numpy()
        beside = shown[:, i * SIDE : (i + 1) * SIDE]
        np.testing.assert_allclose(beside[:SIDE], picture, atol=1 / 255)
        assert (beside[SIDE:] < 0.5).any()


def test_a_refusal_names_the_pictures_of_the_guesses(tmp_path, capsys):
    Image.fromarray(by_hand(CAT)).save(tmp_path / "cat.png")
    with pytest.raises(SystemExit) as ended:
        main(["image", str(tmp_path / "cat.png"), "-o", str(tmp_path / "out")])
    assert ended.value.code == FAULT
    assert f"Their pictures: {tmp_path / 'out' / 'guesses.png'}" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["guesses.png"]


def test_a_folder_with_a_run_gets_no_pictures_of_guesses(tmp_path, capsys):
    Image.fromarray(by_hand(CAT)).save(tmp_path / "cat.png")
    (tmp_path / "run.json").touch()
    with pytest.raises(SystemExit):
        main(["image", str(tmp_path / "cat.png"), "-o", str(tmp_path)])
    assert "holds a run" in capsys.readouterr().err
    assert not (tmp_path / "guesses.png").exists()


@pytest.mark.parametrize("more", [["--shows", "a mug"], ["--library", "folder"]])
def test_guesses_are_among_all_kinds(more, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["image", str(pictured(tmp_path / "a.png", "chair")), "--guess", *more])
    assert ended.value.code == FAULT
    assert f"leave {more[0]} out" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def asked(answer: str, tmp_path, monkeypatch) -> str:
    """What a terminal shows while a cat is drawn, and this is answered."""
    Image.fromarray(by_hand(CAT)).save(tmp_path / "cat.png")
    shown = Terminal()
    monkeypatch.setattr(sys, "stdin", Terminal(answer + "\n"))
    monkeypatch.setattr(sys, "stderr", shown)
    main(["image", str(tmp_path / "cat.png"), "-o", str(tmp_path / "out"), "--steps", "1", "--no-redraw"])
    return shown.getvalue()


@pytest.mark.usefixtures("few_members")
def test_on_a_terminal_one_is_asked(tmp_path, monkeypatch):
    second = ds.recognise(by_hand(CAT)).guesses[1]
    shown = asked("2", tmp_path, monkeypatch)
    assert "Which is it? 1 to 3" in shown
    assert f"Their pictures: {tmp_path / 'out' / 'guesses.png'}" in shown.replace("\n", "")
    assert shown.count("--shows") == 3
    info = json.loads((tmp_path / "out" / "run.json").read_text())["options"]
    assert info["recognised"]["kind"] == second.kind
    assert info["shows"] == second.caption


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_a_phrase_is_an_answer_and_nothing_is_none(tmp_path, monkeypatch):
    asked("a windmill", tmp_path, monkeypatch)
    info = json.loads((tmp_path / "out" / "run.json").read_text())["options"]
    assert info["recognised"]["kind"] == "windmill"
    with pytest.raises(SystemExit) as ended:
        asked("", tmp_path, monkeypatch)
    assert ended.value.code == FAULT


def test_the_weights_say_where_they_are_from_and_are_small():
    from safetensors import safe_open

    assert WEIGHTS.stat().st_size < 3 << 20
    with safe_open(WEIGHTS, "pt") as file:
        assert file.metadata()["source"] == SOURCE
    assert {*trained().kinds} <= {*CATEGORIES}
    kinds, azimuths, elevations = trained().logits(torch.zeros(2, 1, SIZE, SIZE))
    assert (kinds.shape, azimuths.shape, elevations.shape) == (
        (2, len(trained().kinds) + 1),
        (2, len(AZIMUTHS)),
        (2, len(ELEVATIONS)),
    )
