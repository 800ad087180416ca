"""`diff3ds apply`: edits in an SVG drawing come back exactly, all else bit for bit; what has no match is said."""

import json
import re

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats import load_image


def strokes(count=12):
    g = torch.Generator().manual_seed(5)
    loose = ds.Sketch.random(count, generator=g, width=0.01).transform(torch.diag(torch.tensor([0.4, 0.4, 0.4, 1.0])))
    third = torch.tensor([1 / 3, 0.2, 0.1234567])
    opacity = torch.tensor([1.0, 0.5] * 6)[:count]
    return loose.replace(color=third.repeat(count, 1), opacity=opacity, kinds=["crease"] * count)


@pytest.fixture
def drawn(tmp_path):
    """A sketch and its drawing."""
    ds.save(tmp_path / "a.json", strokes())
    main(["render", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.svg"), "--quiet"])
    return tmp_path


def applied(folder, text, capsys, *more):
    """The sketch that comes of an edited text, and what is said."""
    (folder / "edited.svg").write_text(text)
    capsys.readouterr()
    main(["apply", str(folder / "edited.svg"), str(folder / "a.json"), "-o", str(folder / "b.json"), *more])
    return json.loads((folder / "b.json").read_text()), capsys.readouterr().err


def edited(text, ident, change):
    """The text with one element changed, by its id."""
    found = re.search(rf'<path id="{ident}"[^>]*/>', text)
    return text.replace(found[0], change(found[0]))


def test_a_drawing_that_nobody_edited_changes_nothing(drawn, capsys):
    _, said = applied(drawn, (drawn / "a.svg").read_text(), capsys)
    assert (drawn / "b.json").read_bytes() == (drawn / "a.json").read_bytes()
    assert "changed: no colour, opacity, width or name" in said
    assert "warning" not in said


def test_ten_edits_come_back_and_all_else_stays_to_the_last_bit(drawn, capsys):
    text = (drawn / "a.svg").read_text()
    # As Inkscape writes them, by hand, in a group that is enlarged, and in a style sheet as Illustrator does.
    text = edited(
        text, "stroke-0", lambda e: e.replace('stroke="#55331f"', "").replace("/>", ' style="stroke:#ff0000"/>')
    )
    text = edited(text, "stroke-1", lambda e: re.sub(r'stroke="#\w+"', 'stroke="#00ff00"', e))
    text = edited(text, "stroke-2", lambda e: re.sub(r'stroke-width="[^"]*"', 'stroke-width="10.24"', e))
    text = edited(text, "stroke-3", lambda e: e.replace("/>", ' style="stroke-opacity:0.25"/>'))
    text = edited(text, "stroke-4", lambda e: "")
    text = edited(text, "stroke-5", lambda e: e.replace("/>", ' inkscape:label="nose &amp; chin"/>'))
    text = edited(text, "stroke-6", lambda e: f'<g transform="scale(2)">{e}</g>')
    text = edited(
        text,
        "stroke-7",
        lambda e: re.sub(r'(stroke|stroke-width|stroke-opacity)="[^"]*"', "", e).replace("/>", ' class="st0"/>'),
    )
    text = edited(text, "stroke-8", lambda e: e.replace("/>", ' data-name="ear"/>'))
    text = edited(text, "stroke-9", lambda e: f'<g opacity="0.5"><g opacity="0.5">{e}</g></g>')
    sheet = "<style>.st0{fill:none;stroke:#0000ff;stroke-width:5.12;stroke-opacity:.5}</style>"
    text = text.replace(
        '">\n<rect', f'" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape">\n{sheet}<rect', 1
    )
    now, said = applied(drawn, text, capsys)
    was = json.loads((drawn / "a.json").read_text())
    expected = {key: list(value) if isinstance(value, list) else value for key, value in was.items()}
    expected["color"][0], expected["color"][1], expected["color"][7] = [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]
    expected["width"][2], expected["width"][6] = 0.02, 0.02
    expected["opacity"][3], expected["opacity"][9] = 0.25, 0.125
    names = [""] * 12
    names[5], names[8] = "nose & chin", "ear"
    expected["names"] = names
    for key in ("points", "weights", "width", "color", "opacity", "names", "kinds"):
        del expected[key][4]
    assert now.keys() == expected.keys()
    assert {key for key in expected if now[key] != expected[key]} <= {"width"}
    assert now["width"] == pytest.approx(expected["width"], rel=2e-4)
    assert now["width"][0] == was["width"][0]
    assert "changed: 3 colours, 2 opacities, 2 widths, 2 names" in said
    assert "deleted: stroke 4" in said


def test_what_is_hidden_or_left_out_is_not_deleted_and_the_views_own_lines_are_nothing(tmp_path, capsys):
    square = torch.tensor([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    plate = ds.TriangleMesh(square.numpy(), torch.tensor([[0, 1, 2], [0, 2, 3]]).numpy())
    ends = torch.tensor(
        [[[-0.5, 0, -0.5], [0.5, 0, -0.5]], [[-0.5, 0, 0.5], [0.5, 0, 0.5]], [[-3, 0, -0.5], [3, 0, -0.5]]]
    )
    ds.save(tmp_path / "a.json", ds.Sketch(ends))
    from diff3ds.formats.mesh import save_surface

    save_surface(tmp_path / "plate.glb", plate.vertices, plate.faces)
    options = ["--elevation", "90", "--surface", str(tmp_path / "plate.glb"), "--quiet"]
    main(["render", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.svg"), *options])
    text = (tmp_path / "a.svg").read_text()
    # The first is below the plate, and the third is seen on both sides of it.
    assert re.findall(r'<path id="(stroke[^"]*)"', text) == ["stroke-2", "stroke-2-part-2", "stroke-1"]
    now, said = applied(tmp_path, edited(text, "stroke-2-part-2", lambda e: e.replace("#000000", "#ff0000")), capsys)
    assert now["color"] == [[0, 0, 0], [0, 0, 0], [1.0, 0, 0]]
    assert "deleted" not in said
    now, said = applied(tmp_path, edited(text, "stroke-1", lambda e: ""), capsys, "--overwrite")
    assert now["points"] == json.loads((tmp_path / "a.json").read_text())["points"][::2]
    assert "deleted: stroke 1" in said


def test_programs_that_drop_what_the_file_says_of_itself(drawn, capsys):
    text = re.sub(r' data-\w+="[^"]*"', "", (drawn / "a.svg").read_text())
    # On a page of another size.
    text = re.sub(r'viewBox="0 0 512 512"', 'viewBox="0 0 1024 1024"', text)
    text = re.sub(r'stroke-width="([^"]*)"', lambda m: f'stroke-width="{2 * float(m[1]):.3f}"', text)
    text = edited(text, "stroke-3", lambda e: re.sub(r'stroke-width="[^"]*"', 'stroke-width="20.48"', e))
    text = edited(text, "stroke-4", lambda e: "")
    now, said = applied(drawn, text.replace("</svg>", '<path id="path9" d="M0,0L9,9" stroke="red"/></svg>'), capsys)
    was = json.loads((drawn / "a.json").read_text())
    assert now["width"] == pytest.approx([*was["width"][:3], 0.02, *was["width"][5:]], rel=1e-6)
    assert now["width"][0] == was["width"][0]
    assert "does not say any more which strokes it showed" in said
    assert "of no stroke, and left out: path9" in said


def test_drawings_in_a_style_and_of_pens_bring_back_what_they_have(drawn, capsys):
    main(["render", str(drawn / "a.json"), "-o", str(drawn / "pen.svg"), "--centerline", "--quiet"])
    text = edited(
        (drawn / "pen.svg").read_text(), "stroke-3", lambda e: re.sub(r'stroke="#\w+"', 'stroke="#00ff00"', e)
    )
    now, said = applied(drawn, text, capsys)
    assert now["color"][3] == [0, 1.0, 0]
    assert "changed: 1 colours" in said
    assert now["opacity"] == json.loads((drawn / "a.json").read_text())["opacity"]
    pytest.importorskip("pathops", reason="takes the extra styles")
    main(["render", str(drawn / "a.json"), "-o", str(drawn / "ink.svg"), "--style", "ink", "--quiet"])
    text = edited((drawn / "ink.svg").read_text(), "stroke-3", lambda e: re.sub(r'fill="#\w+"', 'fill="#00ff00"', e))
    now, said = applied(drawn, text, capsys, "--overwrite")
    assert now["color"][3] == [0, 1.0, 0]
    assert "changed: 1 colours" in said


def test_a_run_stays_one(drawn, tmp_path, capsys):
    run = tmp_path / "run"
    run.mkdir()
    (drawn / "a.json").rename(run / "sketch.json")
    (run / "run.json").write_text('{"strokes_left": 12}')
    main(["apply", str(drawn / "a.svg"), str(run), "-o", str(tmp_path / "new"), "--quiet"])
    for name in ("sketch.json", "run.json"):
        assert (tmp_path / "new" / name).read_bytes() == (run / name).read_bytes()
    assert len(ds.load(tmp_path / "new")) == 12


def test_pictures_of_a_run_show_the_edits(drawn, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    (drawn / "a.json").rename(run / "sketch.json")
    text = re.sub(r'stroke="#\w+"', 'stroke="#00ff00"', (drawn / "a.svg").read_text())
    (drawn / "a.svg").write_text(re.sub(r'fill="#(?!ffffff)\w+"', 'fill="#00ff00"', text))
    main(["apply", str(drawn / "a.svg"), str(run), "-o", str(tmp_path / "new"), "--quiet"])
    colors = set(re.findall(r'(?:stroke|fill)="(#\w+)"', (tmp_path / "new" / "sketch.svg").read_text()))
    assert colors == {"#00ff00", "#ffffff"}
    pixels = load_image(tmp_path / "new" / "preview.png")
    # White and green alone: no more red than blue, and much more green.
    assert (pixels[..., 0] - pixels[..., 2]).abs().max() < 0.01
    assert (pixels[..., 1] - pixels[..., 0]).max() > 0.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (lambda t: t.replace("stroke-11", "stroke-12"), "has stroke 12, and the sketch 12 strokes"),
        (lambda t: re.sub(r'id="stroke-\d+(-part-\d+)?"', "", t), "has no path of a stroke"),
        (lambda t: t[: len(t) // 2], "not an SVG file"),
    ],
)
def test_drawings_of_other_sketches_are_refused(drawn, capsys, text, said):
    (drawn / "edited.svg").write_text(text((drawn / "a.svg").read_text()))
    with pytest.raises(SystemExit):
        main(["apply", str(drawn / "edited.svg"), str(drawn / "a.json"), "-o", str(drawn / "b.json")])
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (drawn / "b.json").exists()


def test_nothing_is_written_over_unasked(drawn, capsys):
    with pytest.raises(SystemExit):
        main(["apply", str(drawn / "a.svg"), str(drawn / "a.json"), "-o", str(drawn / "a.json")])
    assert "--overwrite" in capsys.readouterr().err
