"""A folder of sketches as a library: what is read of it, and runs with it."""

import hashlib
import json
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from nearness import f_score, points_on

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.library import member
from diff3ds.library.phrase import Request
from diff3ds.library.vocabulary import COLORS
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.picture_lines import lines_of
from diff3ds.tasks.exact_prior import sketch_folder
from diff3ds.tasks.exact_prior.exemplars import arranged, exemplars_in
from diff3ds.tasks.exact_prior.folder_views import recognise_in
from diff3ds.tasks.exact_prior.sketch_folder import read_sketches
from diff3ds.tasks.small_prior.prior_data import shaken
from diff3ds.tasks.text_image.prior_options import PriorOptions

FEW = ["--steps", "2", "--no-redraw", "--quiet", "--sheet-every", "0"]


def drawn(name: str, seed: int = 0, attributes=()) -> ds.Sketch:
    return member(name, torch.Generator().manual_seed(seed), attributes).sketch


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Six sketches of three kinds, notes, and what a run has left."""
    path = tmp_path_factory.mktemp("library")
    (path / "mug").mkdir()
    ds.save(path / "chair_01.json", drawn("chair", 1))
    ds.save(path / "chair_02.json", drawn("chair", 2))
    ds.save(path / "Chair-with-armrests.json", drawn("chair", 3, ("armrests",)))
    ds.save(path / "mug" / "01.json", drawn("mug", 1))
    ds.save(path / "mug" / "02.json", drawn("mug", 2))
    ds.save(path / "space_rocket.json", drawn("rocket", 5))
    (path / "notes.txt").write_text("mine")
    (path / "mug" / "run.json").write_text("{}")
    (path / ".DS_Store").write_bytes(b"\0")
    return path


def test_what_is_read_of_a_folder(folder):
    read = read_sketches(folder)
    assert [name.said for name in read.names] == ["chair with armrests", "chair", "chair", "space rocket", "mug", "mug"]
    assert read.passed == ("notes.txt", "run.json")
    said = str(read)
    assert "6 members in" in said
    assert "chair (3), mug (2), rocket (1); passed over, for they are no sketches: notes.txt, run.json" in said
    # Its own members come back as they were, to the rounding of files and of float32.
    torch.testing.assert_close(read.members[1].sketch.points, drawn("chair", 1).points, atol=1e-6, rtol=0)


def test_members_fill_the_unit_ball_whatever_their_size_place_degree_and_width(tmp_path):
    circle = ds.Sketch(
        torch.tensor([[[7.0, 2.0, 0.0], [7.0, 4.0, 0.0], [5.0, 4.0, 0.0]], [[5.0, 2.0, 0], [5, 2, 1], [5, 2, 2]]]),
        torch.tensor([[1.0, 0.5**0.5, 1.0], [1.0, 1.0, 1.0]]),
        width=0.5,
        color=(1.0, 0.0, 0.0),
        opacity=torch.tensor([0.3, 1.0]),
        width_space="world",
        fixed=torch.tensor([False, True]),
        names=["arc", "line"],
    )
    ds.save(tmp_path / "arc.json", circle)
    (found,) = (one.sketch for one in read_sketches(tmp_path).members)
    points = points_on(found)
    assert float(points.norm(dim=1).max()) == pytest.approx(0.95, abs=1e-3)
    assert ((points.amin(0) + points.amax(0)) / 2).abs().max() < 1e-3
    # A similarity: the quarter circle stays one; its centre was (5, 2, 0), its radius 2, as long as the line.
    scale = float((found.points[1, 3] - found.points[1, 0]).norm()) / 2
    away = (points[:65] - found.points[1, 0]).norm(dim=1)
    torch.testing.assert_close(away, torch.full_like(away, 2 * scale), atol=1e-5, rtol=0)
    assert found.opacity.tolist() == pytest.approx([0.3, 1.0])
    assert found.width_space == "image"
    assert not found.color.any()
    assert found.fixed.tolist() == [False, True]
    assert found.names == ("arc", "line")


def test_strokes_of_several_segments_stay_strokes(tmp_path, monkeypatch):
    """A closed circle of two segments and a line, as `diff3ds views` writes them."""
    points, weights = ds.bezier.circle((3.0, 1.0, 0.0), 2.0, dtype=torch.float32)
    chains = ds.Chains.of([len(points), 1], [True, False])
    rod = ds.Sketch(torch.tensor([[[0.0, 0, 0], [0, 0, 3]]])).elevate(points.shape[1] - 1)
    opacity = torch.tensor([0.4, 1.0])
    wheel = ds.Sketch(
        torch.cat([chains.select(torch.tensor([0]))[1].joined(points), rod.points]),
        torch.cat([weights, rod.weights]),
        opacity=opacity,
        chains=chains,
    )
    library = tmp_path / "library"
    library.mkdir()
    ds.save(library / "wheel.json", wheel)
    folder = read_sketches(library)
    (found,) = folder.members
    arrived = pickle.loads(pickle.dumps(found))
    twice = arranged(found.sketch, Request("wheel", (), 2, None, (1.0, 1.0, 2.0)))
    # Control points that are moved at random keep the joints.
    moved = shaken(found.sketch, 0.1, torch.Generator().manual_seed(0))
    for sketch in (found.sketch, arrived.sketch, twice[:2], twice[2:], moved):
        assert sketch.chains.counts.tolist() == chains.counts.tolist()
        assert sketch.chains.closed.tolist() == [True, False]
        torch.testing.assert_close(sketch.opacity, opacity)
    away = (points_on(found.sketch[[0]]) - points_on(found.sketch[[0]]).mean(0)).norm(dim=1)
    torch.testing.assert_close(away, away.mean().expand(len(away)), rtol=0.05, atol=0)
    with monkeypatch.context() as patch:
        patch.setattr(sketch_folder, "MOST_STROKES", len(points))
        with pytest.raises(ValueError, match=f"wheel.json: {len(points) + 1} segments of strokes; a member"):
            read_sketches(library)
    out = tmp_path / "out"
    main(["text", "a wheel", "--library", str(library), "-o", str(out), "--strokes", "4", *FEW])
    assert (out / "sketch.json").exists()


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_members_of_extreme_size_are_as_others(size, tmp_path):
    chair = drawn("chair").to(torch.float64)
    ds.save(tmp_path / "chair.json", replace(chair, points=size * chair.points))
    (found,) = (one.sketch for one in read_sketches(tmp_path).members)
    torch.testing.assert_close(found.points, drawn("chair").points, atol=1e-6, rtol=0)


def test_a_mesh_is_its_feature_lines(tmp_path, capsys):
    """A box of 3 by 2 by 1: twelve lines from corner to corner, .95 from the middle."""
    pytest.importorskip("trimesh")
    corners = [(x, y, z) for x in (0, 3) for y in (0, 2) for z in (0, 1)]
    faces = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    lines = [*("v {} {} {}".format(*one) for one in corners), *("f {} {} {} {}".format(*one) for one in faces)]
    (tmp_path / "box_1.obj").write_text("\n".join(lines))
    (box,) = read_sketches(tmp_path).members
    assert box.name.noun == "box"
    assert len(box.sketch) == 12
    ends = box.sketch.points[:, [0, 3]]
    half = torch.tensor([1.5, 1.0, 0.5]) * 0.95 / (1.5**2 + 1 + 0.5**2) ** 0.5
    torch.testing.assert_close(ends.abs(), half.expand(12, 2, 3), atol=1e-6, rtol=0)
    # What is broken, or has no size, is named.
    (tmp_path / "box_2.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7")
    assert "box_2.obj: " in fails(["text", "a box", "--library", str(tmp_path), "-o", str(tmp_path / "out")], capsys)
    (tmp_path / "box_2.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2")
    with pytest.raises(ValueError, match=r"box_2.obj: a mesh needs a face with an area"):
        read_sketches(tmp_path)


def test_meshes_that_lines_draw_badly_and_meshes_with_y_up(tmp_path):
    """A flask turned about y: its rim is a circle, which lies flat if y is up; the rest of it is smooth."""
    pytest.importorskip("trimesh")
    turn, tilt = torch.linspace(0, 2 * torch.pi, 49)[:-1], torch.linspace(0.05, 2.6, 24)
    ring = torch.stack([turn.cos(), turn.sin()], -1)
    points = [
        (r * x, -h, r * y)
        for r, h in zip(tilt.sin().tolist(), tilt.cos().tolist(), strict=True)
        for x, y in ring.tolist()
    ]
    quads = [
        (48 * k + i, 48 * k + (i + 1) % 48, 48 * k + 48 + (i + 1) % 48, 48 * k + 48 + i)
        for k in range(23)
        for i in range(48)
    ]
    lines = [
        *("v {} {} {}".format(*one) for one in points),
        *("f {} {} {} {}".format(*(n + 1 for n in one)) for one in quads),
    ]
    (tmp_path / "flask_1.obj").write_text("\n".join(lines))
    read, turned = read_sketches(tmp_path), read_sketches(tmp_path, "y")
    for library, flat in ((read, 1), (turned, 2)):
        (warning,) = library.warnings
        assert "flask_1.obj" in warning
        assert "% of its outlines" in warning
        largest = max(library.members[0].sketch.points, key=lambda stroke: (stroke.amax(0) - stroke.amin(0)).max())
        extent = largest.amax(0) - largest.amin(0)
        assert extent.argmin() == flat
        assert extent[flat] < 1e-4
    assert read.digest != turned.digest
    assert read_sketches(tmp_path).digest == read.digest


def test_the_digest_is_that_of_the_members(folder, tmp_path):
    whole = hashlib.sha256()
    ds.save(tmp_path / "chair.json", drawn("chair"))
    content = (tmp_path / "chair.json").read_bytes()
    whole.update(f"chair.json\0{hashlib.sha256(content).hexdigest()}\n".encode())
    assert read_sketches(tmp_path).digest == whole.hexdigest()
    (tmp_path / "notes.txt").write_text("passed over")
    assert read_sketches(tmp_path).digest == whole.hexdigest()
    (tmp_path / "chair.json").rename(tmp_path / "stool.json")
    assert read_sketches(tmp_path).digest != whole.hexdigest()


def test_members_that_a_phrase_means_come_first_and_all_others_follow(folder):
    read = read_sketches(folder)
    known = exemplars_in(read, "two red mugs")
    assert known.fitting == (True, True, False, False, False, False)
    assert known.color == COLORS["red"]
    assert len(known.members[0]) == 2 * len(drawn("mug", 1))
    assert torch.allclose(known.members[0].color, torch.tensor(COLORS["red"]))
    assert [len(one) for one in known.members[2:]] == [len(read.members[i].sketch) for i in range(4)]


def broken(path: Path, what: str) -> str:
    """A folder with something wrong in it; returns what its error says."""
    chair = drawn("chair")
    match what:
        case "missing":
            path.rmdir()
        case "file":
            path.rmdir()
            path.write_text("{}")
        case "garbage":
            (path / "chair_2.json").write_text("{")
        case "cut":
            content = (path / "chair_1.json").read_bytes()
            (path / "chair_2.json").write_bytes(content[: len(content) // 2])
        case "empty":
            ds.save(path / "chair_2.json", chair[[]])
        case "point":
            ds.save(path / "chair_2.json", replace(chair, points=torch.full_like(chair.points, 0.1)))
        case "weights":
            weights = torch.ones(chair.weights.shape, dtype=torch.float64)
            weights[3, 1] = 1e-200
            ds.save(path / "chair_2.json", replace(chair.to(torch.float64), weights=weights))
        case "mesh":
            (path / "chair_2.fbx").write_text("v 0 0 0")
        case "unnamed":
            ds.save(path / "02.json", chair)
        case "deep":
            (path / "chair" / "more").mkdir(parents=True)
    return {
        "missing": "is a folder of sketches or meshes (.json, .step, .stp, .obj, .stl, .ply, .off, .glb, .gltf), and",
        "file": "is a folder of sketches or meshes",
        "garbage": "chair_2.json: not a JSON file",
        "cut": "chair_2.json: not a JSON file",
        "empty": "chair_2.json: 0 strokes",
        "point": "chair_2.json: all strokes are one point",
        "weights": "chair_2.json: its numbers leave the range of float32 (weights of stroke 3",
        "mesh": "chair_2.fbx: not a kind of mesh that is read: save it as one of .obj, .stl",
        "unnamed": "02.json: '02' does not say what it is: name it so (chair_01.json, or chair/01.json)",
        "deep": "more: a library has sub-folders of sketches, and no folders in them",
    }[what]


@pytest.mark.parametrize(
    "what", ["missing", "file", "garbage", "cut", "empty", "point", "weights", "mesh", "unnamed", "deep"]
)
def test_what_is_wrong_in_a_folder_is_named_before_anything_is_written(what, tmp_path, capsys):
    (tmp_path / "library").mkdir()
    if what not in ("missing", "file"):
        ds.save(tmp_path / "library" / "chair_1.json", drawn("chair"))
    message = broken(tmp_path / "library", what)
    said = fails(["text", "a chair", "--library", str(tmp_path / "library"), "-o", str(tmp_path / "out")], capsys)
    assert message in said
    assert not (tmp_path / "out").exists()


def test_folders_have_bounds(folder, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="holds no sketches or meshes"):
        read_sketches(tmp_path)
    for name, value, message in [
        ("MOST_FILES", 5, "holds 6 sketches"),
        ("MOST_BYTES", 100, "armrests.json: .* bytes are more than the 100"),
        ("MOST_STROKES", 10, "armrests.json: 25 strokes; a member of a library has 1 to 10"),
        ("MOST_STROKES_IN_ALL", 60, "more than 60 strokes in all"),
    ]:
        with monkeypatch.context() as patch:
            patch.setattr(sketch_folder, name, value)
            with pytest.raises(ValueError, match=message):
                read_sketches(folder)


def fails(arguments: list[str], capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == FAULT
    return " ".join(capsys.readouterr().err.split())


def test_a_library_is_for_the_exemplar_prior():
    assert PriorOptions(library=Path("mine")).prior == "exemplar"
    with pytest.raises(ValueError, match="a library is for the prior exemplar, and mvdream has none"):
        PriorOptions("mvdream", Path("mine"))
    with pytest.raises(ValueError, match="exemplar is built in and takes no weights"):
        PriorOptions(library=Path("mine"), weights="owner/name")


@pytest.fixture(scope="module")
def rocket(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("rocket") / "run"
    main(["text", "a rocket", "--library", str(folder), "-o", str(out), "--quiet", "--steps", "250"])
    return out


@pytest.mark.slow
def test_a_phrase_becomes_the_sketch_in_the_folder(rocket, folder):
    found = ds.load(rocket / "sketch.json")
    assert f_score(found, drawn("rocket", 5)) > 0.85
    assert f_score(found, drawn("mug", 1)) < 0.5
    info = json.loads((rocket / "run.json").read_text())["options"]
    assert info["prior"] == "exemplar"
    assert info["library"] == str(folder)
    assert info["library_sha256"] == read_sketches(folder).digest


def test_a_folder_of_one_kind_and_one_sketch_is_enough(tmp_path):
    (tmp_path / "library").mkdir()
    ds.save(tmp_path / "library" / "chair.json", drawn("chair"))
    out = tmp_path / "out"
    main(["text", "a chair", "--library", str(tmp_path / "library"), "-o", str(out), "--steps", "60", "--quiet"])
    assert f_score(ds.load(out / "sketch.json"), drawn("chair")) > 0.85


@pytest.mark.slow
def test_a_changed_library_is_another_run(tmp_path, capsys):
    library = tmp_path / "library"
    library.mkdir()
    ds.save(library / "chair.json", drawn("chair"))
    arguments = ["text", "a chair", "-o", str(tmp_path / "out"), *FEW]
    own = [*arguments, "--library", str(library)]
    main(own)
    before = (tmp_path / "out" / "sketch.json").read_bytes()
    main([*own, "--resume"])
    assert (tmp_path / "out" / "sketch.json").read_bytes() == before
    assert f"library={library}, not None" in fails([*arguments, "--prior", "exemplar", "--resume"], capsys)
    digest = read_sketches(library).digest
    ds.save(library / "mug.json", drawn("mug"))
    assert f"library_sha256={digest}, not" in fails([*own, "--resume"], capsys)


@pytest.fixture(scope="module")
def picture(tmp_path_factory) -> Path:
    """The second chair of the folder from 40 degrees beside its front, 20 above."""
    path = tmp_path_factory.mktemp("picture") / "chair.png"
    save_png(path, ds.render(drawn("chair", 2), ds.orbit(40.0, 20.0, 1.9, size=384)).color[0])
    return path


def test_what_a_picture_shows_of_a_folder(folder, picture):
    lines = lines_of(read_reference(picture))
    found, exemplars = recognise_in(read_sketches(folder), lines)
    assert (found.kind, found.attributes, found.caption) == ("chair", (), "chair")
    assert abs(found.azimuth - 40) <= 5
    assert abs(found.elevation - 20) <= 5
    assert found.confidence > 0.9
    # The chair in the picture, and no other one.
    assert exemplars.fitting == (True, *(False,) * 5)
    torch.testing.assert_close(exemplars.members[0].points, drawn("chair", 2).points, atol=1e-5, rtol=0)


def test_what_one_says_a_picture_shows(folder, picture, tmp_path, capsys):
    read, lines = read_sketches(folder), lines_of(read_reference(picture))
    found, exemplars = recognise_in(read, lines, "a red chair with armrests")
    assert (found.attributes, found.confidence) == (("armrests",), 1.0)
    assert exemplars.color == COLORS["red"]
    assert sum(exemplars.fitting) == 1
    assert len(exemplars.members[0]) == 25
    with pytest.raises(ValueError, match="looks for one thing"):
        recognise_in(read, lines, "two chairs")
    with pytest.raises(ValueError, match="leave words such as big out"):
        recognise_in(read, lines, "a big chair")
    big = ["image", str(picture), "--shows", "a big chair", "-o", str(tmp_path / "out"), *FEW]
    assert "leave words such as big out" in fails(big, capsys)
    with pytest.raises(ValueError, match=r"nothing in .* is named 'dragon'"):
        recognise_in(read, lines, "a dragon")


def test_a_picture_of_nothing_in_the_folder_is_refused(folder, tmp_path, capsys):
    save_png(tmp_path / "bicycle.png", ds.render(drawn("bicycle"), ds.orbit(80.0, 10.0, 1.9, size=384)).color[0])
    arguments = ["image", str(tmp_path / "bicycle.png"), "--library", str(folder), "-o", str(tmp_path / "out")]
    assert "the drawing is not recognised: of what" in fails(arguments, capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_picture_becomes_the_sketch_in_the_folder(folder, picture, tmp_path, capsys):
    main(["image", str(picture), "--library", str(folder), "-o", str(tmp_path), "--steps", "250", "--sheet-every", "0"])
    said = " ".join(capsys.readouterr().err.split())
    assert "library: 6 members in" in said
    assert "recognised: chair (" in said
    assert f_score(ds.load(tmp_path / "sketch.json"), drawn("chair", 2)) > 0.85
    info = json.loads((tmp_path / "run.json").read_text())["options"]
    assert info["library_sha256"] == read_sketches(folder).digest
    assert info["recognised"]["kind"] == "chair"
