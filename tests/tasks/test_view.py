"""`diff3ds view`: a server that shows one page to the browser of its own machine."""

import http.client
import json
import math
import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing

import pytest
import torch
from served_page import served

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.tasks.progress import Progress
from diff3ds.tasks.run_log import RunLog
from diff3ds.tasks.view_sketch.view import server_of


def lines(count: int) -> ds.Sketch:
    return ds.Sketch(torch.arange(6.0 * count).reshape(count, 2, 3).sin())


def asked(server, path: str, method: str = "GET", **headers: str):
    answer, content = fetched(server.server_port, path, method, headers)
    return answer, content.decode()


def fetched(port: int, path: str, method: str = "GET", headers=None, body: bytes | None = None):
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=60)) as connection:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer, answer.read()


@pytest.fixture
def sketch(tmp_path):
    ds.save(tmp_path / "sketch.json", lines(3))
    return tmp_path / "sketch.json"


def count_in(page: str) -> int:
    data = re.search(r'<script type="application/json" id="sketch">(.*?)</script>', page, re.DOTALL)[1]
    return len(json.loads(data)["opacity"])


def test_the_page_has_the_sketch_and_may_ask_its_own_server_alone(sketch):
    for source in (sketch, sketch.parent):
        with served(source) as server:
            assert server.server_address[0] == "127.0.0.1"
            answer, page = asked(server, f"/{server.secret}/")
            assert answer.status == 200
            assert count_in(page) == 3
            images = "img-src 'self'; " if source.is_dir() else ""
            assert f"default-src 'none'; connect-src 'self'; {images}script-src" in page
            assert answer.getheader("Cache-Control") == "no-store"
            assert answer.getheader("X-Frame-Options") == "DENY"
            version = asked(server, f"/{server.secret}/version")[1]
            assert f'"version": "{version}"' in page
            found = json.loads(asked(server, f"/{server.secret}/sketch")[1])
            assert found["start"]["version"] == version
            assert found["sketch"] == json.loads(sketch.read_text())


@pytest.mark.parametrize(
    "path",
    ["/", "/version", "/wrong/", "/{}", "/{}/sketch.json", "/{}/../../etc/passwd", "/{}/%2e%2e/", "//{}/"],
)
def test_nothing_else_is_given(sketch, path):
    with served(sketch) as server:
        answer, text = asked(server, path.format(server.secret))
        assert answer.status == 404
        assert server.secret not in text


def test_other_sites_are_refused(sketch):
    with served(sketch) as server:
        path = f"/{server.secret}/"
        assert asked(server, path, Host="evil.example")[0].status == 403
        assert asked(server, path, Host=f"evil.example:{server.server_port}")[0].status == 403
        assert asked(server, path, Origin="http://evil.example")[0].status == 403
        assert asked(server, path, Origin="null")[0].status == 403
        assert asked(server, path, Origin=f"http://127.0.0.1:{server.server_port}")[0].status == 200
        assert asked(server, path, Host=f"localhost:{server.server_port}")[0].status == 200
        for method in ("PATCH", "OPTIONS", "TRACE"):
            assert asked(server, path, method)[0].status == 405
        assert asked(server, path, "POST")[0].status == 403
        assert sent(server, "", b"", "POST")[0] == 404
    with served(sketch) as other:
        assert other.secret != server.secret


TUNNELS = ("localhost:9000", "127.0.0.1:9000", "[::1]:9000", "LocalHost", "localhost:65535")
# Names that other sites have pointed here, and what is no name.
FOREIGN = (
    "evil.example:9000", "localhost.evil.example:9000", "127.0.0.1.evil.example", "localhost:9000@evil.example", "",
    "evil.example:9000:9000", "127.0.0.2:9000", "[::2]:9000", "localhost:", "localhost:9000/", "hub.example.org",
)  # fmt: skip


def test_tunnels_of_this_machine_reach_the_page_through_any_port(sketch, tmp_path):
    new = text_of(lines(4), tmp_path)
    with served(sketch) as server:
        path = f"/{server.secret}/"
        for host in TUNNELS:
            assert asked(server, path, Host=host, Origin=f"http://{host}")[0].status == 200, host
            assert sent(server, "copy", new, Host=host, Origin=f"http://{host}")[0] == 200, host
        for host in FOREIGN:
            answer, said = asked(server, path, Host=host)
            assert (answer.status, server.secret in said) == (403, False), host
            assert f"ssh -L {server.server_port}:127.0.0.1:{server.server_port}" in said
            assert "--allow-host NAME" in said
            # A page of theirs that asks for this machine by its name.
            assert sent(server, "copy", new, Host="localhost:9000", Origin=f"http://{host}")[0] == 403, host


def test_a_hub_is_let_in_by_name(sketch, tmp_path):
    new = text_of(lines(4), tmp_path)
    with served(sketch, allowed=("Hub.example.org",)) as server:
        for host in ("hub.example.org", "hub.example.org:8443", "localhost:8888"):
            for origin in ("https://hub.example.org", "http://hub.example.org:8443", "http://localhost:8888"):
                assert sent(server, "copy", new, Host=host, Origin=origin)[0] == 200
        for origin in ("https://evil.example", "https://localhost:8888", "ftp://hub.example.org", "https://"):
            assert sent(server, "copy", new, Host="hub.example.org", Origin=origin)[0] == 403
        assert asked(server, f"/{server.secret}/", Host="sub.hub.example.org")[0].status == 403
    for name in ("http://hub.example.org", "hub.example.org/user", "hub.example.org:8000", "", "*"):
        with pytest.raises(ValueError, match="allow_host must be a name alone, such as hub"):
            server_of(sketch, 0, print, allowed=(name,))


def test_another_address_is_listened_on_where_it_is_asked_for(sketch):
    with served(sketch, host="0.0.0.0") as server:
        assert server.server_address[0] == "0.0.0.0"
        # Which names no machine.
        assert server.address.startswith("http://127.0.0.1:")
        assert asked(server, f"/{server.secret}/", Host="localhost:1")[0].status == 200
        assert asked(server, f"/{server.secret}/", Host="evil.example")[0].status == 403
    with pytest.raises(OSError, match=r"no\.such\.example is no address of this machine .*: leave --host out"):
        server_of(sketch, 0, print, host="no.such.example")


def test_a_changed_file_is_another_version_and_a_broken_one_leaves_the_page(sketch):
    said: list[str] = []
    with served(sketch, said) as server:
        version = asked(server, f"/{server.secret}/version")[1]
        ds.save(sketch, lines(5))
        later = asked(server, f"/{server.secret}/version")[1]
        assert later != version
        assert count_in(asked(server, f"/{server.secret}/")[1]) == 5
        sketch.write_text("{ broken")
        for _ in range(3):
            assert asked(server, f"/{server.secret}/version")[1] == later
        assert count_in(asked(server, f"/{server.secret}/")[1]) == 5
        sketch.unlink()
        assert asked(server, f"/{server.secret}/version")[1] == later
        assert len(said) == 2
        assert all("the page shows what there was" in line for line in said)
        ds.save(sketch, lines(2))
        assert count_in(asked(server, f"/{server.secret}/")[1]) == 2


def a_run(folder):
    """The folder of a run under way, with a file that is none of its pictures, and a link that leads out of it."""
    from diff3ds.tasks.run_log import RunLog

    (folder / "progress").mkdir(parents=True)
    for name in ("preview.png", "progress/step_00005.png", "progress/step_00010.png", "other.png"):
        save_png(folder / name, torch.rand(4, 4, 3, generator=torch.Generator().manual_seed(len(name))))
    (folder.parent / "secret.png").write_bytes(b"secret")
    (folder / "lines.png").symlink_to(folder.parent / "secret.png")
    seconds = [0.0]
    log = RunLog(folder, lambda progress: None, lambda line: None, clock=lambda: seconds[0])
    log.say("prior: <b>one</b>")
    for step in range(3):
        loss = [0.5, math.nan, 0.25][step]
        seconds[0] += 10
        log.report(Progress("distill", step + 1, 9, loss, 3, "t 1-2", lines(3).detach))
    return log


def test_a_run_shows_how_far_it_is_and_its_own_pictures_alone(tmp_path):
    log = a_run(tmp_path / "run")
    with served(tmp_path / "run") as server:
        told = json.loads(asked(server, f"/{server.secret}/run")[1])
        assert (told["stage"], told["done"], told["total"], told["ended"]) == ("distill", 3, 9, None)
        assert told["losses"] == {"every": 1, "values": [0.5, None, 0.25]}
        assert told["log"] == ["prior: <b>one</b>", "distill"]
        assert [p["name"] for p in told["pictures"]] == ["progress/step_00010.png", "preview.png"]
        for picture in told["pictures"]:
            path = f"/{server.secret}/picture/{picture['name']}?{picture['version']}"
            answer, content = fetched(server.server_port, path)
            assert answer.getheader("Content-Type") == "image/png"
            assert content == (tmp_path / "run" / picture["name"]).read_bytes()
        for name in ("other.png", "lines.png", "../secret.png", "sketch.json", "progress/../preview.png", "", "?"):
            assert asked(server, f"/{server.secret}/picture/{name}")[0].status == 404, name
        log.end("stopped")
        assert json.loads(asked(server, f"/{server.secret}/run")[1])["ended"] == "stopped"
        (tmp_path / "run/progress.json").write_text('{"version": 1, "losses": 3, "log": "x"}')
        assert "warning" in json.loads(asked(server, f"/{server.secret}/run")[1])["log"][0]


def test_a_file_has_no_run(sketch):
    with served(sketch) as server:
        for name in ("run", "picture/preview.png"):
            assert asked(server, f"/{server.secret}/{name}")[0].status == 404


def test_who_says_nothing_or_nonsense_hinders_nobody(sketch):
    with served(sketch) as server:
        silent = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(5)]
        silent[0].sendall(b"GET / HTTP/1.1\r\nHost: x\r\nA: " + b"b" * 100_000)
        silent[1].sendall(bytes(range(256)) * 10 + b"\r\n\r\n")
        assert asked(server, f"/{server.secret}/")[0].status == 200
        for connection in silent:
            connection.close()


def fails(arguments, capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == FAULT
    return " ".join(capsys.readouterr().err.split())


def test_what_cannot_be_shown_is_said_at_once(sketch, tmp_path, capsys):
    assert "is not there" in fails(["view", str(tmp_path / "none.json")], capsys)
    (tmp_path / "broken.json").write_text("[]")
    assert "broken.json" in fails(["view", str(tmp_path / "broken.json")], capsys)
    assert "port must be from 0 to 65535" in fails(["view", str(sketch), "--port", "70000"], capsys)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert f"port {port} cannot be had" in fails(["view", str(sketch), "--port", port], capsys)


@pytest.mark.slow
def test_the_command_says_where_it_is_and_ends_with_ctrl_c(sketch):
    process = subprocess.Popen(
        [sys.executable, "-m", "diff3ds.cli", "view", str(sketch)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        address = process.stdout.readline().strip()
        found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{20,})/", address)
        assert found, process.stderr.read() if process.poll() is not None else address
        assert fetched(int(found[1]), f"/{found[2]}/")[0].status == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(120) == 0
    finally:
        process.kill()
        process.communicate()


# Saving


def sent(server, name: str, content: bytes, method: str = "PUT", **headers: str):
    given = {"Origin": f"http://127.0.0.1:{server.server_port}", **{k.replace("_", "-"): v for k, v in headers.items()}}
    headers = {k: v for k, v in given.items() if v}
    answer, said = fetched(server.server_port, f"/{server.secret}/{name}", method, headers, content)
    return answer.status, said.decode()


def version_of(server) -> str:
    return asked(server, f"/{server.secret}/version")[1]


def text_of(made: ds.Sketch, folder) -> bytes:
    ds.save(folder / "other.json", made)
    content = (folder / "other.json").read_bytes()
    (folder / "other.json").unlink()
    return content


def test_a_page_saves_the_file_as_the_package_writes_it(sketch, tmp_path):
    new = text_of(lines(4), tmp_path)
    for source in (sketch, sketch.parent):
        ds.save(sketch, lines(3))
        with served(source) as server:
            spaced = json.dumps(json.loads(new), indent=4).encode()
            status, text = sent(server, "sketch", spaced, If_Match=f'"{version_of(server)}"')
            assert status == 200
            assert json.loads(text) == {"version": version_of(server), "name": "sketch.json"}
            assert sketch.read_bytes() == new
    assert [path.name for path in tmp_path.iterdir()] == ["sketch.json"]


def test_a_file_that_has_changed_is_not_written_over(sketch, tmp_path):
    new = text_of(lines(4), tmp_path)
    with served(sketch) as server:
        loaded = version_of(server)
        ds.save(sketch, lines(5))
        before = sketch.read_bytes()
        for given in (loaded, "", "nothing", "*"):
            status, text = sent(server, "sketch", new, If_Match=f'"{given}"')
            assert status == 412
            assert "has changed since this page read it" in text
        assert sketch.read_bytes() == before
        assert json.loads(sent(server, "copy", new)[1]) == {"name": "sketch-2.json"}
        assert json.loads(sent(server, "copy", new)[1]) == {"name": "sketch-3.json"}
        assert (tmp_path / "sketch-2.json").read_bytes() == new
        assert sketch.read_bytes() == before


def test_a_file_of_the_same_size_and_time_is_told_from_another(sketch, tmp_path):
    """By its content: some disks keep time in steps of seconds."""
    new = text_of(lines(4), tmp_path)
    with served(sketch) as server:
        loaded, before = version_of(server), sketch.stat()
        sketch.write_bytes(sketch.read_bytes().replace(b"0.006", b"0.007"))
        os.utime(sketch, ns=(before.st_atime_ns, before.st_mtime_ns))
        assert sketch.stat().st_size == before.st_size
        assert sent(server, "sketch", new, If_Match=f'"{loaded}"')[0] == 412


BROKEN = {
    "nothing": b"",
    "no JSON": b"{",
    "no text": b"\xff\xfe\xfd",
    "deep": b"[" * 100_000,
    "no sketch": b"[1, 2]",
    "infinite": b'{"version": 1, "width_space": "image", "points": [[[1e999, 0, 0], [1, 1, 1]]]}',
}


@pytest.mark.parametrize("name", ["sketch", "copy", "autosave/0123456789abcdef"])
def test_broken_bodies_are_refused_with_a_sentence(sketch, tmp_path, name):
    empty = text_of(ds.Sketch(torch.zeros(0, 4, 3)), tmp_path)
    before = sketch.read_bytes()
    with served(sketch) as server:
        loaded = f'"{version_of(server)}"'
        for what, content in {**BROKEN, "empty": empty}.items():
            status, text = sent(server, name, content, If_Match=loaded)
            assert status == 400, what
            assert len(text) > 20
        status, text = sent(server, name, b"", Content_Length=str(1 << 40), If_Match=loaded)
        assert (status, "are more than" in text) == (413, True)
        assert sent(server, name, b"", Content_Length="-5", If_Match=loaded)[0] == 400
        assert sent(server, name, b"", Transfer_Encoding="chunked", If_Match=loaded)[0] == 411
    assert sketch.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["sketch.json"]


def test_nobody_else_writes_and_nothing_else_is_written(sketch, tmp_path):
    new, before = text_of(lines(4), tmp_path), sketch.read_bytes()
    with served(sketch) as server:
        loaded = f'"{version_of(server)}"'
        here = f"http://127.0.0.1:{server.server_port}"
        for origin in ("http://evil.example", "null", "", here + ".evil.example", "https://127.0.0.1"):
            for method, name in (("PUT", "sketch"), ("PUT", "copy"), ("DELETE", "autosave/0123456789abcdef")):
                assert sent(server, name, new, method, Origin=origin, If_Match=loaded)[0] == 403
        assert sent(server, "sketch", new, Host="evil.example", If_Match=loaded)[0] == 403
        for name in ("../sketch.json", "sketch.json", "", "version", "autosave/", "autosave/../sketch", "autosave/ABC",
                     "autosave/0123456789abcdef.json", "autosave/0123456789abcde/", "sketch/", "run"):  # fmt: skip
            assert sent(server, name, new, If_Match=loaded)[0] == 404, name
            assert sent(server, name, b"", "DELETE")[0] == 404, name
        assert sent(server, "sketch", b"", "DELETE")[0] == 404
        wrong = f"/{'x' * len(server.secret)}/sketch"
        headers = {"Origin": here, "If-Match": loaded}
        assert fetched(server.server_port, wrong, "PUT", headers, new)[0].status == 404
    assert [path.name for path in tmp_path.iterdir()] == ["sketch.json"]
    assert sketch.read_bytes() == before


def test_edits_that_are_not_saved_are_kept_beside_the_file(sketch, tmp_path):
    new, before = text_of(lines(4), tmp_path), sketch.read_bytes()
    first, second = "0123456789abcdef", "fedcba9876543210"
    with served(sketch) as server:
        assert asked(server, f"/{server.secret}/autosaves")[1] == "[]"
        for page in (first, second):
            assert sent(server, f"autosave/{page}", new)[0] == 200
        assert sorted(json.loads(asked(server, f"/{server.secret}/autosaves")[1])) == [first, second]
        assert asked(server, f"/{server.secret}/autosave/{first}")[1].encode() == new
        assert (tmp_path / f"sketch.autosave-{first}.json").read_bytes() == new
        assert sketch.read_bytes() == before
        (tmp_path / f"sketch.autosave-{first}.json").write_text("{")
        answer, said = asked(server, f"/{server.secret}/autosave/{first}")
        assert answer.status == 500
        assert "not a JSON file" in said
        assert sent(server, f"autosave/{first}", b"", "DELETE")[0] == 204
        assert json.loads(asked(server, f"/{server.secret}/autosaves")[1]) == [second]
        assert asked(server, f"/{server.secret}/autosave/{first}")[0].status == 404


@pytest.mark.usefixtures("read_here")
def test_other_formats_are_saved_beside_as_json(tmp_path):
    pytest.importorskip("OCP")
    ds.save(tmp_path / "part.step", lines(3))
    ds.save(tmp_path / "part.json", lines(1))
    before = (tmp_path / "part.json").read_bytes()
    new = text_of(lines(4), tmp_path)
    said: list[str] = []
    with served(tmp_path / "part.step", said) as server:
        status, text = sent(server, "sketch", new, If_Match=f'"{version_of(server)}"')
        assert (status, json.loads(text)["name"]) == (200, "part-2.json")
        assert count_in(asked(server, f"/{server.secret}/")[1]) == 4
        newer = text_of(lines(5), tmp_path)
        assert sent(server, "sketch", newer, If_Match=f'"{version_of(server)}"')[0] == 200
    assert (tmp_path / "part-2.json").read_bytes() == newer
    assert (tmp_path / "part.json").read_bytes() == before
    assert len(ds.load(tmp_path / "part.step")) == 3
    assert said == [f"saved {tmp_path / 'part-2.json'}"] * 2


@pytest.mark.slow
def test_a_run_that_is_viewed_shows_its_page_and_waits_for_ctrl_c(tmp_path):
    """The page is there before there are strokes, has them at the end, and the files are those of any run."""
    options = ["--strokes", "6", "--steps", "30", "--init", "random", "--size", "64", "--quiet"]
    counts, told = {0}, RunLog.report

    def counted(log, progress):
        if progress.sketch is not None:
            counts.add(len(progress.sketch()))
        told(log, progress)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunLog, "report", counted)
        main(["views", "--demo", "-o", str(tmp_path / "plain"), *options])
    final = len(ds.load(tmp_path / "plain" / "sketch.json"))
    process = subprocess.Popen(
        [sys.executable, "-m", "diff3ds.cli", "views", "--demo", "-o", str(tmp_path / "run"), "--view", *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        address = process.stdout.readline().strip()
        found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{20,})/", address)
        assert found, process.stderr.read() if process.poll() is not None else address

        def get(name):
            return fetched(int(found[1]), f"/{found[2]}/{name}")[1].decode()

        # None yet, or those that this run has at one of its steps, of which some drop strokes; at its end the result's.
        shown = [count_in(get(""))]
        end = time.monotonic() + 300
        while json.loads(get("run"))["ended"] != "done":
            shown.append(count_in(get("")))
            assert time.monotonic() < end
            time.sleep(0.1)
        assert {*shown} <= {*counts, final}
        assert [p["name"] for p in json.loads(get("run"))["pictures"]] == ["targets.png", "preview.png"]
        assert count_in(get("")) == final > 0
        # Done, and still there; what the command does after its run may take a moment.
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        assert process.wait(120) == 0
    finally:
        process.kill()
        process.communicate()
    for name in ("sketch.json", "sketch.svg", "preview.png"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()


def test_a_run_that_fails_takes_its_page_with_it(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["mesh", str(tmp_path / "none.obj"), "-o", str(tmp_path / "out"), "--view"])
    said = capsys.readouterr()
    assert said.out.startswith("http://127.0.0.1:")
    assert "none.obj" in said.err
    assert not (tmp_path / "out").exists()
