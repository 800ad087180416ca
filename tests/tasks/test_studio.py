"""The studio: what is understood, drawn and dropped, the line of jobs, and what the page's server answers."""

import http.client
import io
import json
import os
import re
import signal
import subprocess
import sys
import zipfile
from contextlib import closing
from urllib.parse import quote

import numpy as np
import pytest
import torch
from served_page import served_studio
from waiting import until

import diff3ds as ds
from diff3ds.formats.mesh import save_surface
from diff3ds.photogrammetry.find_project import find_project, present_views
from diff3ds.tasks.studio import downloads, dropped
from diff3ds.tasks.studio.drawn import guesses_of, picture_of
from diff3ds.tasks.studio.entry import Entry, entries_in, free_name
from diff3ds.tasks.studio.line import BIN, Line
from diff3ds.tasks.studio.said import understood

GROUP = "0123456789abcdef"
HOUSE = [
    [[30, 50], [30, 85], [70, 85], [70, 50], [30, 50]],
    [[25, 50], [50, 20], [75, 50]],
    [[45, 85], [45, 68], [55, 68], [55, 85]],
]
# A run of a second.
SHORT = {"steps": 12, "size": 64}
CUBE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"


def lines(count: int) -> ds.Sketch:
    return ds.Sketch(torch.arange(6.0 * count).reshape(count, 2, 3).sin())


# Said


def test_a_phrase_is_understood_while_it_is_typed():
    assert understood("a red chair beside a table")["things"] == ["a red chair, beside a table", "a table"]
    slip = understood("two chiars")
    assert slip["refused"] == ""
    assert slip["notes"] == ["'chiars' is taken for 'chairs'"]
    assert understood("  ") == {"things": [], "notes": [], "refused": "", "instead": ""}
    assert "does not know" in understood("a xylophone")["refused"]
    assert understood("a giraffe and a zebra on a xylophone")["instead"] == "a dinosaur and a horse"
    assert "at most" in understood("a " * 400)["refused"]


# Drawn


def test_a_drawing_is_recognised_whatever_its_size():
    found = guesses_of(HOUSE)
    assert found["guesses"][0]["caption"].startswith("a house")
    assert found["guesses"][0]["picture"].startswith("data:image/png;base64,")
    far = [[[1000 + 3 * x, 3 * y - 500] for x, y in stroke] for stroke in HOUSE]
    assert torch.equal(picture_of(far), picture_of(HOUSE))
    # Ink along the strokes, paper elsewhere: the corner of the walls, and the middle of the wall beside the door.
    picture = picture_of(HOUSE)[..., 0]
    scale, middle = 197 / 65, 128
    places = [(int(middle + (y - 52.5) * scale), int(middle + (x - 50) * scale)) for x, y in ((30, 85), (37, 75))]
    assert picture[places[0]] < 0.1
    assert picture[places[1]] == 1


@pytest.mark.parametrize(
    "strokes", [None, [], [[]], [[[1, 2, 3]]], [[["a", 2]]], [[[float("nan"), 1]]], [[[1e9, 1]]], "x", [[[1], [1, 2]]],
                [[[0, 0]]] * 3000]
)  # fmt: skip
def test_what_is_no_drawing_is_refused_with_a_sentence(strokes):
    with pytest.raises(ValueError, match=r"stroke|drawn|drawing"):
        picture_of(strokes)


# Dropped


def drop(out, files: dict[str, bytes]):
    for name, content in files.items():
        coming = out / "coming"
        coming.write_bytes(content)
        dropped.take(out, GROUP, name, coming)
    return dropped.what_is(out, GROUP)


def png() -> bytes:
    from PIL import Image

    held = io.BytesIO()
    Image.new("RGB", (8, 8), "white").save(held, "PNG")
    return held.getvalue()


def zipped(names: dict[str, bytes]) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in names.items():
            archive.writestr(name, content)
    return held.getvalue()


PLY = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n{}end_header\n"
PHOTOGRAPHS = {f"trip/{i}.jpg": png() for i in range(3)}
COLMAP = {f"images/{i}.jpg": png() for i in range(3)} | {
    "database.db": b"x",
    "sparse/0/cameras.txt": b"1 PINHOLE 16 16 20 20 8 8\n",
    "sparse/0/images.txt": "".join(f"{i + 1} 1 0 0 0 0 0 {i + 3} 1 {i}.jpg\n\n" for i in range(3)).encode(),
    "sparse/0/points3D.txt": b"",
}


@pytest.mark.parametrize(
    ("files", "what", "command"),
    [
        ({"cup.png": png()}, "a picture", "image"),
        ({"cup.JPG": png()}, "a picture", "image"),
        ({"part.obj": CUBE.encode()}, "a mesh", "mesh"),
        ({"a/part.obj": CUBE.encode(), "a/part.mtl": b"", "a/wood.png": png()}, "a mesh", "mesh"),
        ({"scan.ply": PLY.format("element face 1\nproperty list uchar int vertex_indices\n").encode()}, "a mesh",
         "mesh"),
        ({"scan.ply": PLY.format("").encode()}, "a cloud of points", "points"),
        ({"scan.xyz": b"0 0 0\n"}, "a cloud of points", "points"),
        ({"part.step": b"ISO-10303-21;" + b" " * 3_000_000 + b"ADVANCED_FACE"}, "solids", "mesh"),
        ({"part.step": b"ISO-10303-21;"}, "a sketch", ""),
        ({"part.igs": b""}, "solids", "mesh"),
        ({"sketch.json": b"{}"}, "a sketch", ""),
        ({f"p/{name}": content for name, content in COLMAP.items()}, "3 photographs of one thing", "views"),
        ({"p.zip": zipped(COLMAP)}, "3 photographs of one thing", "views"),
        (PHOTOGRAPHS, "3 photographs of one thing", "views"),
        ({f"{i}.png": png() for i in range(4)}, "4 pictures of one thing", "views"),
        ({"trip.zip": zipped({**PHOTOGRAPHS, "__MACOSX/trip/._0.png": b"x"})}, "3 photographs of one thing", "views"),
        ({"part.zip": zipped({"part.obj": CUBE.encode()})}, "a mesh", "mesh"),
    ],
)  # fmt: skip
def test_what_was_dropped_is_found_out(tmp_path, files, what, command):
    found = drop(tmp_path, files)
    assert (found.what, found.command) == (what, command)
    assert found.source.exists()
    assert found.source.is_dir() == (command == "views")
    assert found.options == ({"target": "color-edges"} if "photographs" in what else {})


@pytest.mark.parametrize(
    "files", [{f"p/{name}": content for name, content in COLMAP.items()}, {"p.zip": zipped(COLMAP)}]
)
def test_the_cameras_of_a_project_of_colmap_that_is_dropped_are_found(tmp_path, files):
    views = present_views(find_project(drop(tmp_path, files).source))
    assert sorted(view.picture.name for view in views) == ["0.jpg", "1.jpg", "2.jpg"]


@pytest.mark.parametrize(
    "name", ["../x.png", "a/../../x.png", "/x.png", "a//x.png", ".", "..", "a\\x.png", "x\0.png", "C:x.png",
             "a/" * 9 + "x", "x" * 200, ""]
)  # fmt: skip
def test_names_that_lead_elsewhere_are_refused(tmp_path, name):
    with pytest.raises(ValueError, match="cannot be called"):
        drop(tmp_path, {name: b""})
    (tmp_path / "coming").unlink()
    assert not any(path.is_file() for path in tmp_path.rglob("*"))
    with pytest.raises(ValueError, match="cannot be called"):
        drop(tmp_path, {"a.zip": zipped({name.replace("\0", "\x01") or "..": b"", "b.png": png()})})
    assert not (tmp_path.parent / "x.png").exists()


def test_what_is_nothing_or_too_much_is_said(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="names nothing that was dropped"):
        dropped.what_is(tmp_path, "../..")
    with pytest.raises(ValueError, match="nothing has come"):
        dropped.what_is(tmp_path, GROUP)
    with pytest.raises(ValueError, match="is nothing that can be drawn here: drop a picture"):
        drop(tmp_path, {"letter.docx": b""})
    monkeypatch.setattr(dropped, "MOST_FILES", 3)
    with pytest.raises(ValueError, match="at most 3 files"):
        drop(tmp_path, {f"{i}.png": b"" for i in range(4)})
    other = tmp_path / "other"
    other.mkdir()
    with pytest.raises(ValueError, match="no zip that can be unpacked"):
        drop(other, {"a.zip": b"PK nothing"})
    monkeypatch.setattr(dropped, "MOST_UNPACKED", 1000)
    again = tmp_path / "again"
    again.mkdir()
    with pytest.raises(ValueError, match="unpacks to 1 files of 100000 bytes"):
        drop(again, {"a.zip": zipped({"zeros.png": b"0" * 100_000})})
    two = tmp_path / "two"
    two.mkdir()
    with pytest.raises(ValueError, match="make no set of photographs"):
        drop(two, {"a.png": png(), "b.png": png()})


# The line


def settled(line: Line, name: str, *states: str) -> Entry:
    return until(lambda: (entry := line.entry(name)) is not None and entry.state in states and entry, f"{states}")


def test_things_are_made_one_after_the_other_stopped_and_gone_on_with(tmp_path):
    said: list[str] = []
    with Line(tmp_path, said.append) as line:
        first = line.add("A chair!", "text", {"phrase": "a chair", **SHORT})
        long = line.add("a table", "text", {"phrase": "a table", "steps": 100_000})
        last = line.add("a chair!", "text", {"phrase": "a chair", **SHORT, "seed": 1})
        assert [first.name, long.name, last.name] == ["a-chair", "a-table", "a-chair-2"]
        for name in ("a-table", "a-chair-2"):
            with pytest.raises(ValueError, match="there is nothing to go on with"):
                line.resume(name)
        assert settled(line, "a-chair", "done").message == ""
        assert len(ds.load(tmp_path / "a-chair")) > 0
        settled(line, "a-table", "running")
        with pytest.raises(ValueError, match="stop it first"):
            line.delete("a-table")
        until(lambda: long.done, "a step")
        line.stop("a-table")
        assert settled(line, "a-table", "stopped").state == "stopped"
        assert settled(line, "a-chair-2", "done").state == "done"
        # What it reached is there, and it goes on from that.
        reached = json.loads((tmp_path / "a-table/run.json").read_text())
        assert reached["stopped_early"]
        line.resume("a-table")
        settled(line, "a-table", "running")
        copy = line.duplicate("a-chair")
        assert (copy.title, copy.state) == ("A chair! (copy)", "done")
        assert (tmp_path / copy.name / "sketch.json").read_bytes() == (tmp_path / "a-chair/sketch.json").read_bytes()
        line.delete("a-chair")
        assert line.entry("a-chair") is None
        assert next((tmp_path / BIN).glob("a-chair-*/sketch.json")).is_file()
        with pytest.raises(ValueError, match="nothing called"):
            line.delete("a-chair")
    assert not said
    # The studio has ended: what was being made waits for the next one.
    assert {entry.name: entry.state for entry in entries_in(tmp_path)} == {
        "a-table": "waiting", "a-chair-2": "done", copy.name: "done",
    }  # fmt: skip


def test_the_time_that_is_left_is_that_of_all_stages(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("diff3ds.tasks.studio.entry.monotonic", lambda: now[0])
    entry = Entry("a-chair", "a chair", "text", {}, 0.0, "running")
    entry.begin()
    before = {"starting": 2.0, "distill": 20.0, "redraw": 4.0}
    assert entry.times(before) == {"spent": 0.0, "stage": None, "all": pytest.approx(26.0)}
    now[0] = 4.0
    entry.tell({"stage": "distill", "done": 0, "total": 400})
    # Getting ready took twice as long as before: what is ahead goes by the pace of 24 in place of 22 seconds.
    assert entry.times(before)["all"] == pytest.approx(20 + 24 / 22 * 4)
    now[0] = 14.0
    entry.tell({"stage": "distill", "done": 100, "total": 400})
    # Ten seconds for a quarter: forty for all of it, which is half the pace of before.
    assert entry.times(before) == {"spent": 14.0, "stage": pytest.approx(30.0), "all": pytest.approx(30 + 2 * 4)}
    assert entry.times({})["all"] is None
    entry.tell({"stage": "new", "done": 0, "total": None})
    assert entry.times(before) == {"spent": 14.0, "stage": None, "all": None}
    assert entry.took == {"starting": 4.0, "distill": 10.0}


def test_what_is_made_alike_tells_the_time(tmp_path):
    with Line(tmp_path, lambda text: None) as line:
        first = settled(line, line.add("a chair", "text", {"phrase": "a chair", **SHORT}).name, "done")
        assert {"starting", "distill"} <= {*first.took}
        assert sum(first.took.values()) > 0.1
    # It is kept, and told of what is made with the same options alone.
    line = Line(tmp_path, lambda text: None)
    assert line.took_before(line.add("a table", "text", {"phrase": "a table", **SHORT})) == first.took
    assert line.took_before(line.add("a table", "text", {"phrase": "a table", "steps": 99})) == {}
    drawn = Entry("a", "a", "image", {"picture": "a.png", "shows": "a mug"}, 0.0, "done", took={"distill": 3.0})
    line._entries["a"] = drawn
    other = Entry("b", "b", "image", {"picture": "b.png", "shows": "a cat"}, 0.0)
    assert line.took_before(other) == drawn.took


def test_what_cannot_be_made_says_why(tmp_path):
    (tmp_path / "sources").mkdir()
    (tmp_path / "sources/flat.obj").write_text("nonsense\n")
    said: list[str] = []
    with Line(tmp_path, said.append) as line:
        for options in ({"phrase": "a chair", "steps": "x"}, {"phrase": "a chair", "nonsense": 1}, {"phrase": ""}):
            with pytest.raises((ValueError, TypeError)):
                line.add("x", "text", options)
        with pytest.raises(FileNotFoundError):
            line.add("x", "mesh", {"source": "none.obj"})
        entry = line.add("flat", "mesh", {"source": "sources/flat.obj"})
        failed = settled(line, entry.name, "failed")
        assert "flat.obj" in failed.message
        assert said == [f"flat: {failed.message}"]
        with pytest.raises(ValueError, match="there is nothing to draw anew"):
            line.again(entry.name)
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()].count("x") == 0


def test_the_command_of_a_thing_does_the_same_in_a_terminal(tmp_path):
    from diff3ds.cli import main

    entry = Entry("a-chair", "a chair", "text", {"phrase": "a chair", **SHORT, "start": "b/sketch.json"}, 0.0)
    line = entry.line(tmp_path)
    assert line == (
        f"diff3ds text 'a chair' --steps 12 --size 64 --from {tmp_path}/b/sketch.json -o {tmp_path}/a-chair"
    )
    ds.save(tmp_path / "b/sketch.json", lines(4))
    import shlex

    main([*shlex.split(line)[1:], "--quiet"])
    assert len(ds.load(tmp_path / "a-chair")) == 4


def test_files_of_others_in_the_folder_are_left_alone(tmp_path):
    for name, content in {"mine": "{", "theirs": '{"version": 2}', "no": "[]"}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "studio.json").write_text(content)
    (tmp_path / "plain").mkdir()
    assert entries_in(tmp_path) == []
    assert free_name(tmp_path, "Mine") == "mine-2"
    assert free_name(tmp_path, "../ Überall ") == "berall"
    assert free_name(tmp_path, "日本") == "sketch"


# What the server answers


@pytest.fixture
def studio(tmp_path):
    with served_studio(tmp_path) as server:
        yield server


def call(server, name: str, method: str = "GET", body=None, **headers: str):
    given = {"Origin": f"http://127.0.0.1:{server.server_port}", **headers}
    with closing(http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=60)) as connection:
        connection.request(method, f"/{server.secret}/{name}", body, {k: v for k, v in given.items() if v})
        answer = connection.getresponse()
        return answer.status, answer.read(), answer


def put(server, name: str, content) -> tuple[int, object]:
    status, body, _ = call(server, name, "PUT", json.dumps(content).encode())
    return status, json.loads(body) if status == 200 else body.decode()


def test_the_page_may_ask_its_own_server_alone(studio):
    status, body, answer = call(studio, "")
    assert status == 200
    assert "default-src 'none'; connect-src 'self'" in body.decode()
    assert answer.getheader("X-Frame-Options") == "DENY"
    assert call(studio, "", Host="evil.example")[0] == 403
    assert call(studio, "jobs", "PUT", b"{}", Origin="http://evil.example")[0] == 403
    assert call(studio, "jobs", "PUT", b"{}", Origin="")[0] == 403
    for name in ("nothing", "runs/none/", "runs/../x", "jobs/none/explode", "state/", "files/short/x.png"):
        assert call(studio, name)[0] == 404, name
    for name in ("state", "said", "runs/none/", "jobs/none/explode"):
        assert call(studio, name, "PUT", b"{}")[0] == 404, name
    assert call(studio, "jobs/none/stop", "PUT", b"")[0] == 400
    assert json.loads(call(studio, f"said?phrase={quote('a chair')}")[1])["things"] == ["a chair"]


def test_what_comes_is_bounded_and_lies_in_its_folder(studio, tmp_path, monkeypatch):
    from diff3ds.tasks.serving import serve

    assert call(studio, f"files/{GROUP}/cup.png", "POST", png())[0] == 200
    assert put(studio, "dropped", {"group": GROUP}) == (200, {"what": "a picture", "title": "cup", "command": "image"})
    for name in (f"files/{GROUP}/%2e%2e/x.png", f"files/{GROUP}/..%2fx.png", f"files/{GROUP}/a%00.png"):
        status, body, _ = call(studio, name, "POST", b"x")
        assert (status, b"cannot be called" in body) == (400, True), name
    assert call(studio, f"files/{GROUP}/x.png", "POST", b"", **{"Content-Length": str(1 << 40)})[0] == 413
    assert call(studio, "files/x.png", "POST", b"x")[0] == 404
    monkeypatch.setattr(serve, "MOST_FILE", 10)
    assert call(studio, f"files/{GROUP}/large.png", "POST", b"x" * 11)[0] == 413
    for wrong in (b"", b"{", b"[]", b"\xff", b"[" * 100_000):
        for name in ("jobs", "drawn", "dropped"):
            assert call(studio, name, "PUT", wrong)[0] == 400, (name, wrong[:3])
    inside = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert inside == {f"sources/{GROUP}/cup.png"}


def test_things_of_all_kinds_come_into_the_line(studio, tmp_path):
    assert put(studio, "jobs", {"phrase": " a chair "})[1]["line"].startswith("diff3ds text 'a chair' -o ")
    status, drawn = put(studio, "jobs", {"strokes": HOUSE, "shows": "a house", "group": GROUP})
    assert (status, drawn["title"], drawn["command"]) == (200, "a house", "image")
    assert (tmp_path / f"sources/{GROUP}/drawing.png").is_file()
    assert "--shows 'a house'" in drawn["line"]
    other = "f" * 16
    call(studio, f"files/{other}/part.obj", "POST", CUBE.encode())
    status, mesh = put(studio, "jobs", {"group": other})
    assert (status, mesh["command"], mesh["state"]) == (200, "mesh", "waiting")
    for wrong in ({"phrase": "a xylophone"}, {}, {"strokes": []}, {"strokes": HOUSE, "shows": 3, "group": GROUP}):
        assert put(studio, "jobs", wrong)[0] == 400
    told = json.loads(call(studio, "state")[1])
    assert [(entry["title"], entry["state"]) for entry in told] == [
        ("part", "waiting"), ("a house", "waiting"), ("a chair", "waiting"),
    ]  # fmt: skip
    assert put(studio, f"jobs/{mesh['name']}/stop", {})[0] == 200
    assert studio.line.entry(mesh["name"]).state == "stopped"


def test_a_sketch_that_is_dropped_is_shown_saved_and_told_in_every_format(studio, tmp_path):
    ds.save(tmp_path / "mine.json", lines(3))
    call(studio, f"files/{GROUP}/mine.json", "POST", (tmp_path / "mine.json").read_bytes())
    status, entry = put(studio, "jobs", {"group": GROUP})
    assert (status, entry["state"], entry["line"]) == (200, "done", "")
    page = call(studio, "runs/mine/")[1].decode()
    assert "<title>mine</title>" in page
    assert "Back to the studio" in page
    assert json.loads(call(studio, "runs/mine/sketch")[1])["sketch"]["points"]
    about = json.loads(call(studio, "runs/mine/about")[1])
    assert [each["key"] for each in about["formats"]] == [*downloads.FORMATS]
    assert call(studio, f"runs/mine/{entry['face']}")[1].startswith(b"\x89PNG")
    edited = (tmp_path / "mine.json").read_bytes()
    version = call(studio, "runs/mine/version")[1].decode()
    assert call(studio, "runs/mine/sketch", "PUT", edited, **{"If-Match": f'"{version}"'})[0] == 200
    for key in ("json", "svg", "png", "html", "obj", "blender", "plotter"):
        status, content, answer = call(studio, f"runs/mine/download/{key}?azimuth=400&elevation=95&detail=1")
        assert status == 200, content
        assert re.fullmatch(
            rf'attachment; filename="mine\{downloads.FORMATS[key].suffix}"', answer.getheader("Content-Disposition")
        )
    assert call(studio, "runs/mine/download/json")[1] == (tmp_path / "mine/sketch.json").read_bytes()
    for wrong in ("stl", "svg?azimuth=x", "svg?style=oil", "svg?detail=7", "svg?azimuth=nan"):
        assert call(studio, f"runs/mine/download/{wrong}")[0] == 400, wrong
    call(studio, f"files/{'e' * 16}/broken.json", "POST", b"[]")
    assert put(studio, "jobs", {"group": "e" * 16})[0] == 400
    assert [entry.name for entry in studio.line.entries()] == ["mine"]


def test_a_drawing_is_saved_with_the_looks_that_were_chosen(studio, tmp_path):
    ds.save(tmp_path / "mine.json", lines(3))
    call(studio, f"files/{GROUP}/mine.json", "POST", (tmp_path / "mine.json").read_bytes())
    put(studio, "jobs", {"group": GROUP})

    def paths(looks: str) -> int:
        status, content, _ = call(studio, f"runs/mine/download/svg?{looks}")
        assert status == 200, content
        return content.count(b"<path")

    about = json.loads(call(studio, "runs/mine/about")[1])
    assert about["hatches"] == []
    bare = paths("hatch=light")
    corners = np.array([[-1.0, -1, -1], [1, -1, -1], [0, 1, -1], [0, 0, 1]])
    save_surface(tmp_path / "mine/surface.glb", corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    assert json.loads(call(studio, "runs/mine/about")[1])["hatches"] == ["light", "depth"]
    assert paths("hatch=light&hidden=show") > paths("hidden=show") >= bare
    plain, on_paper = (call(studio, f"runs/mine/download/png?style=ink{more}") for more in ("", "&paper=true"))
    assert plain[0] == on_paper[0] == 200
    assert plain[1] != on_paper[1]
    assert call(studio, "runs/mine/download/svg?hatch=x")[0] == 400


@pytest.mark.slow
def test_what_is_killed_goes_on_with_the_next_studio(tmp_path):
    def begin():
        process = subprocess.Popen(
            [sys.executable, "-m", "diff3ds.cli", "studio", "-o", str(tmp_path / "made"), "--no-open", "--quiet"],
            stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        port, secret = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/", process.stdout.readline().strip()).groups()
        return process, type("Server", (), {"server_port": int(port), "secret": secret})

    def state(server):
        return json.loads(call(server, "state")[1])[0]

    process, server = begin()
    try:
        put(server, "jobs", {"phrase": "a chair"})
        until(lambda: state(server)["state"] == "running" and state(server)["done"] >= 50, "half of the job")
        process.kill()
        process.communicate()
        process, server = begin()
        until(lambda: state(server)["state"] == "done", "the job's end")
        process.send_signal(signal.SIGINT)
        assert process.wait(120) == 0
    finally:
        process.kill()
        process.communicate()
    assert json.loads((tmp_path / "made/a-chair/run.json").read_text())["stopped_early"] is False
