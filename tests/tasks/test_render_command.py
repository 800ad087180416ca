"""`diff3ds render`: views, sheets and turntables of a sketch, read back by other programs."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from needs import needs
from PIL import Image

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats import save_png
from diff3ds.formats.framing import ball_of, framed
from diff3ds.formats.mesh import save_surface
from diff3ds.tasks.render import blender_engine
from diff3ds.tasks.render.render_options import OrbitOptions, PictureOptions, SurfaceOptions, parse_size
from diff3ds.tasks.render.render_views import run_render
from diff3ds.tasks.style_options import StyleOptions

# A thick stroke along z and a red one along +x, which is at the right only from some sides.
POINTS = torch.tensor([[[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
SKETCH = ds.Sketch(POINTS, width=0.05, color=torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))


@pytest.fixture
def source(tmp_path):
    ds.save(tmp_path / "sketch.json", SKETCH)
    return tmp_path / "sketch.json"


def drawn(source, file, *options) -> np.ndarray:
    main(["render", str(source), "-o", str(file), "--size", "64", "--quiet", *map(str, options)])
    return np.asarray(Image.open(file))


def red_columns(picture: np.ndarray) -> np.ndarray:
    """Columns with red ink."""
    return np.flatnonzero(((picture[..., 0] > 128) & (picture[..., 1] < 64)).any(0))


def test_the_azimuth_turns_the_sketch(source, tmp_path):
    """From -y (azimuth -90) +x is at the right, from +y at the left."""
    front = red_columns(drawn(source, tmp_path / "a.png", "--azimuth", -90, "--elevation", 0))
    back = red_columns(drawn(source, tmp_path / "b.png", "--azimuth", 90, "--elevation", 0))
    assert front.max() > 40
    assert back.min() < 24


def test_a_level_of_detail_is_drawn_from_where_all_is_seen(source, tmp_path):
    """The red stroke is the shorter one, and without it the other one stays where it is."""
    whole = drawn(source, tmp_path / "a.png")
    few = drawn(source, tmp_path / "b.png", "--detail", 0)
    assert len(red_columns(whole))
    assert not len(red_columns(few))
    dark = whole.max(-1) < 64
    assert dark.sum() > 50
    assert (few.max(-1)[dark] < 64).all()


def test_an_orthographic_height_is_the_height_of_the_picture(source, tmp_path):
    """The stroke along z is 2 units long, half of a picture 4 units high: 32 px and its width of 3.2."""
    picture = drawn(source, tmp_path / "a.png", "--height", 4, "--elevation", 0, "--azimuth", -90)
    rows = np.flatnonzero((picture[..., 1] < 128)[:, 22:26].any(1))
    assert rows[-1] - rows[0] + 1 == pytest.approx(35.2, abs=1.5)


def test_several_views_are_numbered_files_or_a_sheet(source, tmp_path):
    main(["render", str(source), "-o", str(tmp_path / "v.png"), "--size", "32", "--azimuth", "0", "90", "--quiet"])
    alone = [np.asarray(Image.open(tmp_path / f"v-{i}.png")) for i in (1, 2)]
    assert not (tmp_path / "v.png").exists()
    main(["render", str(source), "-o", str(tmp_path / "s.png"), "--size", "32", "--azimuth", "0", "90", "--sheet"])
    assert (np.asarray(Image.open(tmp_path / "s.png")) == np.concatenate(alone, 1)).all()


def test_views_of_a_transforms_json(source, tmp_path):
    cameras = ds.orbit([0, 90], 10, 4, size=(48, 32))
    ds.save_transforms(tmp_path / "transforms.json", cameras, [tmp_path / "0.png", tmp_path / "1.png"])
    main(["render", str(source), "-o", str(tmp_path / "v.png"), "--cameras", str(tmp_path), "--quiet"])
    expected = (ds.render(ds.load(source), cameras).color * 255).round().byte().numpy()
    for i in (1, 2):
        found = np.asarray(Image.open(tmp_path / f"v-{i}.png"))
        assert np.abs(found.astype(int) - expected[i - 1]).max() <= 1


def test_a_transparent_background_shows_the_same_over_white(source, tmp_path):
    white = drawn(source, tmp_path / "a.png").astype(float)
    clear = drawn(source, tmp_path / "b.png", "--background", "transparent").astype(float)
    assert clear.shape == (64, 64, 4)
    assert clear[0, 0, 3] == 0
    alpha = clear[..., 3:] / 255
    assert np.abs(clear[..., :3] * alpha + 255 * (1 - alpha) - white).max() <= 1.5


@pytest.mark.filterwarnings("always")
def test_plotters_get_a_background_only_where_one_is_asked_for(source, tmp_path, capsys):
    """They would draw the edge of the page."""
    drawing = ["render", str(source), "-o", str(tmp_path / "a.svg"), "--quiet", "--centerline"]
    for options, there in (([], False), (["--background", "white"], True), (["--background", "transparent"], False)):
        main([*drawing, *options])
        assert ("<rect" in (tmp_path / "a.svg").read_text()) == there
        assert ("plotters and cutters draw its edge" in capsys.readouterr().err) == there


UNFITTED = ["--fit", "none", "--quiet"]


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_a_turntable_goes_once_round(suffix, source, tmp_path):
    main(
        [
            "render",
            str(source),
            "-o",
            str(tmp_path / f"t{suffix}"),
            "--size",
            "48",
            "--turntable",
            "4",
            "--fit",
            "none",
            "--quiet",
        ]
    )
    with Image.open(tmp_path / f"t{suffix}") as movie:
        assert movie.n_frames == 4
        total = 0
        for i in range(4):
            movie.seek(i)
            movie.load()
            total += movie.info["duration"]
            expected = (ds.render(SKETCH, framed(SKETCH, 30 + 90 * i, 20, size=48)).color[0] * 255).round().numpy()
            assert np.abs(np.asarray(movie.convert("RGB")).astype(float) - expected).mean() < 1
    assert total == pytest.approx(4000 / 24, abs=6)


def test_a_turntable_is_fitted_to_all_its_frames(source, tmp_path):
    """The stroke along z is 2 units high, the other one sticks out by 1 to each side: their union fills the height."""
    main(["render", str(source), "-o", str(tmp_path / "t.webp"), "--size", "80x100", "--turntable", "4", "--quiet"])
    with Image.open(tmp_path / "t.webp") as movie:
        frames = []
        for i in range(movie.n_frames):
            movie.seek(i)
            frames.append(np.asarray(movie.convert("RGB")).min(2) < 128)
    rows, columns = (np.flatnonzero(np.any(frames, (0, axis))) for axis in (2, 1))
    # A twentieth of the shorter side, 4 px, is free all round.
    assert (rows[0], 99 - rows[-1]) == (pytest.approx(4, abs=1), pytest.approx(4, abs=1))
    assert columns[0] >= 3
    assert columns[-1] <= 76


def test_pages_of_several_views(source, tmp_path):
    """A page each in a PDF file, or a sheet; SVG and PNG files are numbered."""
    page = ["--page", "A6", "--azimuth", "0", "90", "--quiet"]
    for options, files in (
        (["v.pdf"], ["v.pdf"]),
        (["s.pdf", "--sheet"], ["s.pdf"]),
        (["v.svg"], ["v-1.svg", "v-2.svg"]),
        (["v.png", "--dpi", "25.4"], ["v-1.png", "v-2.png"]),
        (["s.png", "--dpi", "25.4", "--sheet"], ["s.png"]),
    ):
        main(["render", str(source), "-o", str(tmp_path / options[0]), *options[1:], *page])
        assert [file.name for file in sorted(tmp_path.glob(options[0].replace(".", "*.")))] == files
    assert [
        (tmp_path / name).read_bytes().count(b"/MediaBox [0 0 297.6378 419.5276]") for name in ("v.pdf", "s.pdf")
    ] == [2, 1]
    with Image.open(tmp_path / "s.png") as picture:
        assert picture.size == (105, 148)


@needs("av")
def test_a_turntable_as_mp4(source, tmp_path):
    import av

    main(
        [
            "render",
            str(source),
            "-o",
            str(tmp_path / "t.mp4"),
            "--size",
            "64x48",
            "--turntable",
            "5",
            "--fit",
            "none",
            "--quiet",
        ]
    )
    with av.open(str(tmp_path / "t.mp4")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert container.streams.video[0].average_rate == 24
    assert len(frames) == 5
    for i, frame in enumerate(frames):
        expected = (ds.render(SKETCH, framed(SKETCH, 30 + 72 * i, 20, size=(48, 64))).color[0] * 255).numpy()
        assert np.abs(frame.astype(float).mean(-1) - expected.mean(-1)).mean() < 4


@pytest.mark.parametrize("size", [(64, 64), (40, 90), (90, 40)])
@pytest.mark.parametrize("place", [0.0, 4e6])
def test_a_sketch_is_in_the_picture_whatever_its_shape_and_place(size, place):
    """The ball around the sketch takes nine tenths of the shorter side."""
    sketch = ds.Sketch(SKETCH.points.double() + place, width=0.001)
    middle, radius = ball_of(sketch)
    cameras = framed(sketch, [0, 40, 200], 20, size=size)
    around = torch.randn(500, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    rim = middle + radius * torch.nn.functional.normalize(around, dim=-1)
    seen, _ = cameras.seen(torch.cat([rim, rim[:, :1] * 0 + 1], -1) @ cameras.projection.mT)
    reach = (seen - seen.new_tensor([size[1] / 2, size[0] / 2])).norm(dim=-1).amax()
    assert 0.42 * min(size) < reach < 0.5 * min(size)


def test_sizes():
    assert parse_size("512") == (512, 512)
    assert parse_size("1280x720") == (720, 1280)
    for text in ("0", "12x", "axb", "-5", "70000", "100000x100000", ""):
        with pytest.raises(ValueError, match="size must be a number of pixels or WIDTHxHEIGHT"):
            parse_size(text)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "a.jpg"], "a.jpg: cannot draw to '.jpg', only to .png, .svg, .pdf, .dxf, .hpgl, .plt, .mp4"),
        (["-o", "a.mp4"], "a .mp4 file holds a turntable: give --turntable"),
        (["-o", "a.png", "--turntable", "5"], "a turntable goes to .mp4, .webp, .gif, .py, not to .png"),
        (["-o", "a.gif", "--turntable", "5", "--background", "transparent"], "no partly transparent pixels"),
        (["-o", "a.gif", "--turntable", "5", "--fps", "60"], "fps must be at most 50"),
        (["-o", "a.mp4", "--turntable", "5", "--size", "5x4"], "size must be even both ways"),
        (["-o", "a.webp", "--turntable", "5", "--azimuth", "0", "9"], "a turntable goes once round from one --azimuth"),
        (["-o", "a.png", "--turntable", "1"], "--turntable must be from 2"),
        (["-o", "a.png", "--size", "0"], "--size must be a number of pixels or WIDTHxHEIGHT"),
        (
            ["-o", "a.svg", "--page", "A9"],
            "--page must be A0, A1, A2, A3, A4, A5, A6, letter, legal, tabloid or WIDTHxHEIGHT",
        ),
        (
            ["-o", "a.svg", "--page", "A4", "--margin", "1ft"],
            "--margin must be a number of millimetres, or one with mm, cm or in",
        ),
        (
            ["-o", "a.svg", "--page", "A4", "--margin", "105"],
            "less than half of the page's shorter side, 105 mm, got 105 mm",
        ),
        (["-o", "a.svg", "--landscape"], "--landscape is for pages: give a --page too, such as A4"),
        (["-o", "a.svg", "--fit", "page"], "--fit is for pages and turntables: give a --page too"),
        (["-o", "a.svg", "--page", "A4", "--dpi", "300"], "--dpi is for .png, .mp4, .webp, .gif files"),
        (["-o", "a.png", "--page", "A0", "--dpi", "300"], "of 9933 x 14043 pixels, more than"),
        (["-o", "a.eps"], "write .pdf or .svg, which hold the same paths, and convert it"),
        (["-o", "a.png", "--layers", "color"], "--layers is for .svg, .pdf, .hpgl, .plt, .dxf and .py files"),
        (["-o", "a.png", "--centerline"], "--centerline is for .svg, .pdf, .hpgl and .plt files"),
        (["-o", "a.pdf", "--tolerance", "0"], "--tolerance must be positive"),
        (["-o", "a.png", "--elevation", "91"], "--elevation must be from -90 to 90"),
        (["-o", "a.png", "--height", "0"], "--height must be positive"),
        (["-o", "a.png", "--detail", "2"], "--detail must be from 0 (one stroke) to 1"),
        (["-o", "a.png", "--strokes", "0"], "--strokes must be a whole number, at least 1"),
        (["-o", "a.png", "--background", "pink"], "--background must be white, black or R,G,B"),
        (["-o", "a.png", "--fov", "30", "--height", "2"], "either --fov or --height"),
        (["-o", "a.png", "--cameras", "x", "--distance", "2"], "give either --cameras or --distance"),
        (["-o", "a.png", "--cameras", "x.json"], "x.json"),
    ],
)
def test_faults_are_sentences_and_leave_nothing(arguments, message, source, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["render", str(source), *arguments])
    assert ended.value.code == 1
    assert message in " ".join(capsys.readouterr().err.split())
    assert [path.name for path in tmp_path.iterdir()] == ["sketch.json"]


def test_without_blender_it_says_where_to_get_it(source, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(blender_engine.shutil, "which", lambda name: None)
    monkeypatch.setattr(blender_engine.importlib.util, "find_spec", lambda name: None)
    for options, message in (
        (("out.png",), "Blender was not found: install it"),
        (("out.svg",), "Blender draws .png files"),
        (("out.png", "--height", 2), "one perspective view"),
        (("out.png", "--azimuth", 0, 90), "one perspective view"),
    ):
        with pytest.raises(SystemExit):
            drawn(source, tmp_path / options[0], "--engine", "blender", *options[1:])
        assert message in " ".join(capsys.readouterr().err.split())
    assert [path.name for path in tmp_path.iterdir()] == ["sketch.json"]


def test_a_source_that_is_not_there_is_named(tmp_path, capsys):
    with pytest.raises(SystemExit):
        drawn(tmp_path / "nothing", tmp_path / "out.png")
    assert "nothing is not there: give the folder of a run" in " ".join(capsys.readouterr().err.split())


def test_what_blender_says_when_it_fails_is_told(source, tmp_path, monkeypatch):
    (tmp_path / "out.png").write_bytes(b"old")
    # A program that fails, in Blender's place.
    monkeypatch.setattr(blender_engine, "_command", lambda: [sys.executable, "-c", "raise SystemExit('no GPU today')"])
    picture = PictureOptions(engine="blender")
    with pytest.raises(OSError, match=r"Blender drew nothing.*no GPU today"):
        run_render(
            source, tmp_path / "out.png", OrbitOptions(), picture, SurfaceOptions(), StyleOptions(), lambda _: None
        )
    assert (tmp_path / "out.png").read_bytes() == b"old"


WALL = "v 0.5 -2 -2\nv 0.5 2 -2\nv 0.5 2 2\nv 0.5 -2 2\nf 1 2 3 4\n"


def test_a_surface_hides_what_lies_behind_it(source, tmp_path):
    """From +x the wall at x = 1/2 hides the stroke along z, and leaves half of the red one, which comes towards us."""
    (tmp_path / "wall.obj").write_text(WALL)
    view = ("--azimuth", 10, "--elevation", 0, "--surface", tmp_path / "wall.obj")
    behind = ("--azimuth", 190, "--elevation", 0, "--surface", tmp_path / "wall.obj")
    whole = (drawn(source, tmp_path / "a.png", *view, "--hidden", "show") < 128).any(2).sum()
    seen = (drawn(source, tmp_path / "b.png", *view) < 128).any(2).sum()
    assert 0 < seen < 0.3 * whole
    assert (drawn(source, tmp_path / "c.png", *behind) < 128).any(2).sum() > 0.8 * whole
    faint = drawn(source, tmp_path / "d.png", *view, "--hidden", "faint")
    assert faint[10:50].min(axis=(1, 2)).max() < 200
    main(["render", str(source), "-o", str(tmp_path / "e.svg"), "--quiet", *map(str, view)])
    assert (tmp_path / "e.svg").read_text().count("<path") == 1


def test_double_precision_is_drawn_over_any_background(tmp_path):
    ds.save(tmp_path / "double.json", SKETCH.to(torch.float64))
    assert drawn(tmp_path / "double.json", tmp_path / "a.png", "--background", "1,0,0")[0, 0].tolist() == [255, 0, 0]


def test_the_surface_of_a_run_hides_lines_when_asked(source, tmp_path, capsys):
    """A folder with the wall as its surface: without --hidden it hides nothing, from the other side neither."""
    with pytest.raises(SystemExit):
        drawn(tmp_path, tmp_path / "a.png", "--hidden", "drop")
    assert "has no surface.glb" in capsys.readouterr().err
    corners = np.array([[0.5, -2, -2], [0.5, 2, -2], [0.5, 2, 2], [0.5, -2, 2]])
    save_surface(tmp_path / "surface.glb", corners, np.array([[0, 1, 2], [0, 2, 3]]))
    view = ("--azimuth", 10, "--elevation", 0)
    whole, seen, behind = (
        (drawn(tmp_path, tmp_path / "b.png", *options) < 128).any(2).sum()
        for options in (
            view,
            (*view, "--hidden", "drop", "--no-contours"),
            ("--azimuth", 190, "--elevation", 0, "--hidden", "drop", "--no-contours"),
        )
    )
    assert 0 < seen < 0.3 * whole
    assert behind > 0.8 * whole


def test_the_surface_of_a_run_is_hatched_when_asked(source, tmp_path, capsys):
    """Lines on a wall that is seen from the front: so many millimetres apart as asked, on a page so wide."""
    corners = np.array([[-0.5, -2, -2], [-0.5, 2, -2], [-0.5, 2, 2], [-0.5, -2, 2]])
    save_surface(tmp_path / "surface.glb", corners, np.array([[0, 1, 2], [0, 2, 3]]))
    view = ("--azimuth", 0, "--elevation", 0, "--height", 3, "--hatch", "light", "--tones", 1, "--size", 200)

    def count(name: str, *options) -> int:
        main(["render", str(tmp_path), "-o", str(tmp_path / name), "--quiet", *map(str, (*view, *options))])
        return sum("<path" in line for line in (tmp_path / name).read_text().splitlines())

    page = ("--page", "80x80", "--margin", 0, "--fit", "none")
    few, many = count("a.svg", "--spacing", 10), count("b.svg", "--spacing", "2mm", *page)
    # Twice as many lines, beside the two strokes.
    assert 20 < few < 40
    assert abs((many - 2) / (few - 2) - 2) < 0.1
    # A picture whose right half is black.
    half = torch.ones(8, 8, 3)
    half[:, 4:] = 0
    save_png(tmp_path / "half.png", half)
    assert abs(count("e.svg", "--spacing", 10, "--hatch", tmp_path / "half.png") / few - 1) < 0.2
    for given, message in [
        ("dark", "or the file of a picture, got 'dark': no such file"),
        (__file__, Path(__file__).name),
    ]:
        with pytest.raises(SystemExit):
            count("f.svg", "--hatch", given)
        assert message in capsys.readouterr().err
        assert not (tmp_path / "f.svg").exists()
    # Dots are many more, and twice as near to each other four times as many.
    few, many = count("c.svg", "--spacing", 10, "--stipple"), count("d.svg", "--spacing", 5, "--stipple")
    assert few > 200
    assert abs((many - 2) / (few - 2) - 4) < 0.4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--hidden", "faint"], "give a --surface with --hidden"),
        (["--no-contours"], "give a --surface, or --hidden or --hatch for that of a run, with --no-contours"),
        (["--hatch", "light"], "give a --surface with --hidden or --hatch"),
        (["--tones", "2"], "give --hatch light or --hatch depth too"),
        (["--stipple"], "give --hatch light or --hatch depth too"),
        (["--hatch", "light", "--tones", "5"], "must be from 1 to 4, got 5"),
        (["--hatch", "light", "--spacing", "wide"], "as 5, 5px or .8mm, got 'wide'"),
        (["--hatch", "light", "--spacing", ".1mm"], "got '.1mm', 0.378 pixels here"),
        (["--surface-up", "y"], "give a --surface with --surface-up"),
        (["--surface", "none.obj", "--engine", "blender"], "in pictures by the kernels"),
    ],
)
def test_surfaces_go_with_what_can_have_them(source, tmp_path, capsys, options, message):
    with pytest.raises(SystemExit):
        main(["render", str(source), "-o", str(tmp_path / "a.png"), *options])
    assert message in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()
