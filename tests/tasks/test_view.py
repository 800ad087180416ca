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
import threading
from contextlib import contextmanager

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.tasks.progress import Progress
from diff3ds.tasks.view.serve import server_of


def lines(count: int) -> ds.Sketch:
    return ds.Sketch(torch.arange(6.0 * count).reshape(count, 2, 3).sin())


@contextmanager
def served(source, said=None):
    server = server_of(source, 0, (said if said is not None else []).append)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def asked(server, path: str, method: str = "GET", **headers: str):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    return answer, answer.read().decode()


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
    ["/", "/version", "/wrong/", "/{}", "/{}/sketch.json", "/{}/../../etc/passwd", "/{}/%2e%2e/", "/{}/?x"],
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
        for method in ("POST", "PUT", "DELETE", "OPTIONS"):
            assert asked(server, path, method)[0].status == 501
    with served(sketch) as other:
        assert other.secret != server.secret


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
            connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
            connection.request("GET", f"/{server.secret}/picture/{picture['name']}?{picture['version']}")
            answer = connection.getresponse()
            assert answer.getheader("Content-Type") == "image/png"
            assert answer.read() == (tmp_path / "run" / picture["name"]).read_bytes()
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


def test_the_command_says_where_it_is_and_ends_with_ctrl_c(sketch):
    process = subprocess.Popen(
        [sys.executable, "-m", "diff3ds.cli", "view", str(sketch)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        address = process.stdout.readline().strip()
        found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{20,})/", address)
        assert found, process.stderr.read() if process.poll() is not None else address
        connection = http.client.HTTPConnection("127.0.0.1", int(found[1]), timeout=10)
        connection.request("GET", f"/{found[2]}/")
        assert connection.getresponse().status == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.communicate()
