"""Members that the recogniser has not seen, drawn from known sides; `diff3ds image` with the built-in prior."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from nearness import f_score
from PIL import Image, ImageDraw

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import load_image, save_png
from diff3ds.library import CATEGORIES, member
from diff3ds.library.members import added_strokes
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.network import TURNS, trained
from diff3ds.recognition.picture_lines import Lines, lines_of
from diff3ds.recognition.recognise import Guess, NotRecognised, recognise, recognised, seen_as
from diff3ds.recognition.side_seen import alike, cameras_at, confidence, descriptors, gap, pieces, placed_over
from diff3ds.tasks.text_image import priors
from diff3ds.tasks.text_image.image import inked

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from other_drawings import solid_drawing

HELD_OUT = 1000


def drawn(name: str, attributes=(), seed=HELD_OUT) -> ds.Sketch:
    return member(name, torch.Generator().manual_seed(seed), attributes).sketch


def pictured(path, sketch: ds.Sketch, azimuth: float, elevation: float):
    save_png(path, ds.render(sketch, ds.orbit(azimuth, elevation, 1.9, size=384)).color[0])
    return path


def lines_in(path):
    return lines_of(read_reference(path))


@pytest.fixture(scope="module")
def chair(tmp_path_factory):
    """A chair with armrests from 40 degrees beside its front, 20 above."""
    folder = tmp_path_factory.mktemp("chair")
    return pictured(folder / "chair.png", drawn("chair", ("armrests",)), 40.0, 20.0)


@pytest.fixture(scope="module")
def cross(tmp_path_factory):
    """What the library has not."""
    image = Image.new("L", (300, 300), 255)
    pen = ImageDraw.Draw(image)
    pen.line((20, 150, 280, 150), 0, 5)
    pen.line((150, 20, 150, 280), 0, 5)
    path = tmp_path_factory.mktemp("cross") / "cross.png"
    image.save(path)
    return path


@pytest.mark.slow
def test_what_members_of_other_seeds_are(tmp_path):
    """One of every third kind; azimuths are odd multiples of 7.5 degrees: farthest from those of the tables."""
    kinds = trained().kinds[::3]
    guessed = {}
    for i, name in enumerate(kinds):
        found = recognise(lines_in(pictured(tmp_path / "a.png", drawn(name), 37.5 + 75 * i, 8.0)))
        guessed[name] = found.guesses[0].kind
    assert len(kinds) > 25
    # Of all plain drawings 97 % are named rightly (docs/results/pictures.md).
    assert len({name: guess for name, guess in guessed.items() if guess != name}) <= 1, guessed


def test_attributes_and_pose_of_what_has_no_symmetry(chair):
    found = recognised(lines_in(chair))
    assert (found.kind, found.attributes) == ("chair", ("armrests",))
    assert abs(found.azimuth - 40) <= 7.5
    assert abs(found.elevation - 20) <= 10
    assert found.confidence > 0.8
    assert found.caption == "a chair with armrests"


# A chair by hand, seen from half beside its front: seat, round back, straight legs.
BY_HAND = [
    [(40, 165), (145, 140), (220, 155), (125, 190), (40, 165), (40, 185), (125, 212), (220, 172), (220, 155)],
    [(125, 190), (125, 212)],
    [(140, 140), (140, 80), (155, 45), (190, 30), (220, 45), (232, 85), (222, 155)],
    [(147, 140), (147, 85), (162, 52), (190, 40), (213, 52), (222, 85), (214, 152)],
    [(42, 187), (44, 245), (60, 245), (64, 193)],
    [(118, 211), (118, 262), (134, 262), (138, 208)],
    [(206, 180), (198, 232), (206, 250), (220, 172)],
    [(106, 207), (108, 238), (116, 236), (118, 211)],
]


def test_attributes_that_a_drawing_lacks_are_not_invented(tmp_path):
    """A rocking chair is more like it, seat, round back and all; but where are its rockers?"""
    image = Image.new("L", (280, 290), 255)
    for line in BY_HAND:
        ImageDraw.Draw(image).line(line, fill=0, width=6, joint="curve")
    image.save(tmp_path / "chair.png")
    found = seen_as(lines_in(tmp_path / "chair.png"), "chair")
    assert found.attributes == ()
    assert found.caption == "a chair"
    # From where the rocking chair would be seen: in front.
    assert abs((found.azimuth + 180) % 360 - 180) < 90
    # Those that are named, or drawn, are there.
    assert seen_as(lines_in(tmp_path / "chair.png"), "chair", ("rocking",)).attributes == ("rocking",)
    rocking = pictured(tmp_path / "rocking.png", drawn("chair", ("rocking",)), 40.0, 20.0)
    assert seen_as(lines_in(rocking), "chair").attributes == ("rocking",)


def test_strokes_that_attributes_add():
    plain, armed = drawn("chair", seed=3), drawn("chair", ("armrests",), seed=3)
    added = added_strokes("chair", 3, ("armrests",))
    assert added.sum() == len(armed) - len(plain) == 4
    assert added_strokes("chair", 3, ("stool",)).all()
    assert not added_strokes("chair", 3, ()).any()


def test_pose_of_what_is_known_to_be_there(chair):
    found = seen_as(lines_in(chair), "chair", ("armrests", "high back"))
    assert found.attributes == ("armrests", "high back")
    assert abs(found.azimuth - 40) <= 7.5
    assert found.confidence == 1


def test_what_the_library_lacks_is_refused_with_three_guesses(cross):
    with pytest.raises(NotRecognised, match=r"(?s)does not recognise the drawing: .*fetch zero123") as refused:
        recognised(lines_in(cross))
    guesses = refused.value.recognition.guesses
    assert len({guess.kind for guess in guesses}) == 3
    assert guesses[0].confidence >= guesses[1].confidence >= guesses[2].confidence
    assert all(f'--shows "{guess.caption}"' in str(refused.value) for guess in guesses)


def test_confidence_rises_with_score_and_lead_and_falls_with_the_gap():
    assert confidence(0.97, 0.90, 0.02) > confidence(0.92, 0.85, 0.02) > confidence(0.92, 0.90, 0.02)
    assert confidence(0.97, 0.90, 0.01) > confidence(0.97, 0.90, 0.03)
    assert confidence(0.99, 0.80, 0.01) > 0.95
    assert confidence(0.80, 0.80, 0.03) < 0.1


def test_gap_of_one_of_two_lines():
    """Two lines of length 1, .5 apart, of which the picture has one: half of the points lie .5 from it.

    A picture's points lie up to half a piece from the middles of 32 pieces, a quarter of one in the mean.
    """
    ends = torch.tensor([[[0.0, -0.4, 0.2], [0.0, 0.4, 0.2]], [[0.0, -0.4, -0.2], [0.0, 0.4, -0.2]]])
    along = torch.linspace(0, 1, 4)[:, None]
    sketch = ds.Sketch(ends[:, :1] + along * (ends[:, 1:] - ends[:, :1]), torch.ones(2, 4))
    camera = ds.orbit(0.0, 0.0, 3.0, size=1)
    x = np.linspace(-0.5, 0.5, 2001)
    one = Lines(np.stack([x, np.full_like(x, 0.25)], 1), np.zeros((2001, 2)))
    both = Lines(np.concatenate([one.points, one.points * [1, -1]]), np.zeros((4002, 2)))
    assert gap(one, sketch, camera) == pytest.approx((0.5 / 2 + 1 / 128) / 2, abs=0.001)
    assert gap(both, sketch, camera) == pytest.approx(1 / 256, abs=0.001)


@pytest.mark.parametrize("shape", ["ellipse", "rectangle"])
def test_a_bare_circle_and_a_bare_square_are_nothing(shape, tmp_path):
    image = Image.new("L", (300, 300), 255)
    getattr(ImageDraw.Draw(image), shape)((40, 40, 260, 260), outline=0, width=5)
    image.save(tmp_path / "shape.png")
    assert not ds.recognise(tmp_path / "shape.png").taken


@pytest.mark.slow
def test_a_house_without_its_hidden_lines(tmp_path):
    """As one draws it: three edges of its twelve end behind it."""
    sketch, camera = drawn("house"), ds.orbit(35.0, 15.0, 1.9, size=512)
    save_png(tmp_path / "house.png", solid_drawing(sketch, camera, outlined=True))
    found = recognised(lines_in(tmp_path / "house.png"))
    assert (found.kind, found.attributes) == ("house", ())
    assert abs(found.azimuth - 35) <= 10


def test_a_drawing_is_looked_at_turned_a_little_too(monkeypatch):
    # An L whose arms are as long as each other, turned by a quarter about its middle.
    arm = np.linspace(-0.5, 0.5, 11)
    lines = Lines(
        np.concatenate([np.stack([arm, np.full(11, 0.5)], 1), np.stack([np.full(11, -0.5), arm], 1)]),
        np.repeat([[0.1, 0.0], [0.0, 0.1]], 11, 0),
    )
    turned = lines.turned(90)
    assert np.allclose(turned.points[:11], np.stack([np.full(11, -0.5), arm], 1))
    assert np.allclose(turned.tangents[:11], [0.0, 0.1])
    eighth = lines.turned(45)
    assert np.allclose(np.ptp(eighth.points, 0).max(), 1)
    assert np.allclose(np.linalg.norm(eighth.tangents, axis=1), 0.1 / 2**0.5)
    # The network is asked about all turns, and its probabilities are averaged.
    network, asked = trained(), []

    def logits(self, pictures):
        asked.append(pictures)
        kinds = torch.zeros(len(pictures), len(self.kinds) + 1)
        kinds[0, 3], kinds[1:, 5] = 20.0, 20.0
        return kinds * self.temperature, torch.zeros(len(pictures), 24), torch.zeros(len(pictures), 3)

    monkeypatch.setattr(type(network), "logits", logits)
    found = network.opinion(lines).kinds
    assert len(asked[0]) == len(TURNS) > 2
    assert sorted(TURNS) == sorted(-degrees for degrees in TURNS)
    assert torch.equal(asked[0][0, 0], torch.from_numpy(lines.ink(64, 2 / 64, 54 / 64)))
    assert found[3] == pytest.approx(1 / len(TURNS), abs=1e-6)
    assert found[5] == pytest.approx(1 - 1 / len(TURNS), abs=1e-6)


def test_descriptors_are_unit_vectors_that_count_a_line_once():
    camera = ds.orbit(40.0, 20.0, 1.9, size=1)
    points, tangents = pieces(drawn("bicycle"), camera)
    (once,) = descriptors(points, tangents)
    (twice,) = descriptors(torch.cat([points, points], 1), torch.cat([tangents, -tangents], 1))
    assert float(once.norm()) == pytest.approx(1, abs=1e-5)
    assert float(once @ twice) > 0.97
    # A mirrored picture is another one, a turned tangent is the same line.
    flip = torch.tensor([-1.0, 1.0])
    assert float(once @ descriptors(points * flip, tangents * flip)[0]) < 0.9
    torch.testing.assert_close(descriptors(points, -tangents)[0], once)


def test_lines_that_cross_are_told_apart_by_direction():
    """A line of 1 along x, and the same points as pieces along y."""
    points = torch.stack([torch.linspace(-0.5, 0.5, 100), torch.zeros(100)], 1)[None]
    along, across = torch.tensor([0.01, 0.0]).expand(1, 100, 2), torch.tensor([0.0, 0.01]).expand(1, 100, 2)
    assert float(descriptors(points, along)[0] @ descriptors(points, across)[0]) == 0


def test_members_like_the_picture_are_of_its_proportions(tmp_path):
    """Of a member that is in the pool, the first is that member."""
    sketch = drawn("table", seed=17)
    lines = lines_in(pictured(tmp_path / "a.png", sketch, 30.0, 15.0))
    found = seen_as(lines, "table")
    assert any(torch.equal(one.sketch.points, sketch.points) for one in alike(lines, "table", (), found.camera, 3))


def test_lines_are_drawn_where_the_camera_sees_them(tmp_path):
    """A member's own lines, found in its picture, over the member: as the renderer draws it, to a part of a pixel."""
    sketch, camera = drawn("house"), ds.orbit(30.0, 15.0, 1.9, size=64)
    picture = placed_over(lines_in(pictured(tmp_path / "a.png", sketch, 30.0, 15.0)), sketch, camera).picture(64, 0.05)
    wide = ds.Sketch(sketch.points, sketch.weights, width=torch.full_like(sketch.width, 0.05))
    error = (picture - ds.render(wide, camera).color[0]).abs().mean()
    ink = 1 - float(picture.mean())
    assert 0.1 < ink < 0.5
    assert float(error) < 0.1 * ink


@pytest.fixture(scope="module")
def run(chair, tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "out"
    main(["image", str(chair), "-o", str(out), "--steps", "60", "--sheet-every", "0", "--quiet"])
    return out


def test_a_picture_becomes_its_thing(run):
    """F-score at 5 % of the size against the member that was drawn, in the frame of the library."""
    assert f_score(ds.load(run / "sketch.json"), drawn("chair", ("armrests",))) > 0.85


def test_the_run_says_what_was_recognised(run, chair):
    info = json.loads((run / "run.json").read_text())["options"]
    assert info["prior"] == "exemplar"
    found = recognised(lines_in(chair))
    assert info["recognised"] == json.loads(json.dumps(found.as_json()))
    assert info["recognised"]["kind"] == "chair"
    assert torch.allclose(load_image(run / "reference.png"), read_reference(chair).image, atol=1 / 255)
    assert (run / "lines.png").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_it_is_said_which_prior_and_what_is_recognised(chair, tmp_path, capsys):
    main(["image", str(chair), "-o", str(tmp_path), "--steps", "1", "--no-redraw"])
    said = " ".join(capsys.readouterr().err.split())
    assert "prior: the built-in prior, because" in said
    assert "recognised: a chair with armrests (" in said


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_a_run_goes_on_with_what_it_recognised(chair, tmp_path):
    arguments = [
        "image",
        str(chair),
        "--steps",
        "4",
        "--no-redraw",
        "--prior",
        "exemplar",
        "--quiet",
        "--sheet-every",
        "0",
    ]
    main([*arguments, "-o", str(tmp_path / "out")])
    before = (tmp_path / "out" / "sketch.json").read_bytes()
    main([*arguments, "-o", str(tmp_path / "out"), "--resume"])
    assert (tmp_path / "out" / "sketch.json").read_bytes() == before


def fails(arguments, capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == FAULT
    return " ".join(capsys.readouterr().err.split())


def test_what_is_refused_leaves_no_files(cross, chair, tmp_path, capsys):
    out = ["-o", str(tmp_path / "out")]
    assert "does not recognise" in fails(["image", str(cross), *out], capsys)
    # What the picture may show; nothing else.
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["guesses.png"]
    (tmp_path / "out" / "guesses.png").unlink()
    unknown = fails(["image", str(chair), "--shows", "a zeppelin", *out], capsys)
    assert "does not know 'zeppelin'" in unknown
    assert "for pictures zero123" in unknown
    assert "looks for one thing" in fails(["image", str(chair), "--shows", "two chairs", *out], capsys)
    assert "leave words such as tall out" in fails(["image", str(chair), "--shows", "a tall chair", *out], capsys)
    zero123 = ["--prior", "zero123", "--shows", "a chair"]
    assert "--shows is for the built-in prior" in fails(["image", str(chair), *zero123, *out], capsys)
    assert not [*(tmp_path / "out").iterdir()]


@pytest.mark.slow
def test_a_kind_that_the_network_has_not_seen_can_be_named(tmp_path, monkeypatch):
    lines = lines_in(pictured(tmp_path / "cat.png", drawn("cat"), 40.0, 12.0))
    before = trained()
    # As if the library had grown by the cat and all kinds after it: for the network they are things that are none.
    fewer = replace(before, kinds=before.kinds[: before.kinds.index("cat")])
    monkeypatch.setattr("diff3ds.recognition.recognise.trained", lambda: fewer)
    with pytest.raises(NotRecognised, match=rf"one of the library's {len(CATEGORIES)}, say so with --shows"):
        recognised(lines)
    found = seen_as(lines, "cat")
    assert (found.kind, found.attributes, found.caption) == ("cat", (), "a cat")
    assert abs(found.azimuth - 40) <= 7.5
    assert abs(found.elevation - 12) <= 7.5


@pytest.mark.slow
def test_it_is_drawn_as_what_one_says_it_shows(cross, tmp_path):
    main(
        [
            "image",
            str(cross),
            "--shows",
            "a red windmill",
            "-o",
            str(tmp_path),
            "--steps",
            "2",
            "--no-redraw",
            "--quiet",
        ]
    )
    info = json.loads((tmp_path / "run.json").read_text())["options"]
    assert info["recognised"]["kind"] == "windmill"
    red = torch.tensor([0.8, 0.1, 0.1])
    assert torch.allclose(ds.load(tmp_path / "sketch.json").color, red)


@pytest.mark.parametrize(
    ("device", "weights", "best", "reason"),
    [
        ("cpu", True, "exemplar", "Zero123-XL has no GPU here"),
        ("cuda", False, "exemplar", "weights are not here (diff3ds fetch zero123)"),
        ("cuda", True, "zero123", "Zero123-XL, whose weights and a GPU are here"),
    ],
)
def test_the_network_is_taken_where_it_can_work(device, weights, best, reason, monkeypatch):
    monkeypatch.setattr(priors, "pick_device", lambda name: torch.device(device))
    monkeypatch.setattr(priors, "has_weights", lambda name: weights and name == "zero123")
    name, said = priors.best_prior("zero123", "auto")
    assert name == best
    assert reason in said


def test_a_drawing_takes_the_colour_of_the_strokes():
    picture = torch.tensor([[[1.0, 1, 1], [0, 0, 0], [0.5, 0.5, 0.5]]])
    red = inked(picture, (0.8, 0.1, 0.1))
    assert torch.allclose(red, torch.tensor([[[1.0, 1, 1], [0.8, 0.1, 0.1], [0.9, 0.55, 0.55]]]))
    assert inked(picture, None) is picture


@pytest.mark.parametrize(
    ("azimuth", "elevation", "words"),
    [
        (55.0, 0.0, "55 degrees to the right of the front, 0 above"),
        (340.0, 12.4, "20 degrees to the left of the front, 12 above"),
        (-20.0, -10.0, "20 degrees to the left of the front, 10 below"),
        (0.2, 5.0, "in front, 5 above"),
        (359.8, 5.0, "in front, 5 above"),
        (180.0, 5.0, "behind, 5 above"),
    ],
)
def test_poses_in_words(azimuth, elevation, words):
    """Right is where the camera goes that goes to +y: to the right of the picture from the front."""
    assert str(Guess("mug", (), azimuth, elevation, 0.97, "a mug")) == f"a mug (97%), seen from {words}"
    camera = cameras_at([(azimuth, elevation)]).centers[0]
    right = ds.orbit([0.0], size=9)
    seen = ds.project(ds.Sketch(torch.stack([camera, camera])[None] * 0.1), right).cubics[0, 0, 0]
    if "right" in words or "left" in words:
        assert ("right" in words) == (float(seen[0] / seen[2]) > 4.5)
