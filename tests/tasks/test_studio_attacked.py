"""The studio under load and attack: long lines, floods, broken uploads, and files that are not what they seem."""

import http.client
import io
import json
import socket
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from served_page import served_studio
from waiting import until

from diff3ds.tasks.serving import serve
from diff3ds.tasks.studio.entry import entries_in
from diff3ds.tasks.studio.line import Line

CUBE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
LOTS = "&a;" * 10
BOMB = (
    '<?xml version="1.0"?><!DOCTYPE svg [<!ENTITY a "x">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{"&" + chr(97 + i) + ";"}{LOTS}">' for i in range(9))
    + ']><svg xmlns="http://www.w3.org/2000/svg"><text>&j;</text></svg>'
)


def group(number: int) -> str:
    return f"{number:016x}"


def asked(server, name: str, method: str = "GET", body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    given = {"Origin": f"http://127.0.0.1:{server.server_port}", **headers}
    with closing(http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=120)) as connection:
        connection.request(method, f"/{server.secret}/{name}", body, given)
        answer = connection.getresponse()
        return answer.status, answer.read()


def wanted(server, content: dict) -> tuple[int, bytes]:
    return asked(server, "jobs", "PUT", json.dumps(content).encode())


def files_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def zipped(files: dict[str, bytes]) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return held.getvalue()


def png(size: tuple[int, int] = (16, 16)) -> bytes:
    held = io.BytesIO()
    Image.fromarray(np.zeros((*size[::-1], 3), np.uint8)).save(held, "PNG")
    return held.getvalue()


def test_twenty_jobs_wait_in_the_order_in_which_they_were_asked_for(tmp_path):
    with served_studio(tmp_path) as server:
        with ThreadPoolExecutor(8) as pool:
            answers = list(pool.map(lambda n: wanted(server, {"phrase": f"{'very ' * n}old chair"}), range(20)))
        assert [status for status, _ in answers] == [200] * 20
        told = json.loads(asked(server, "state")[1])
        assert len({entry["name"] for entry in told}) == 20
        assert {entry["state"] for entry in told} == {"waiting"}
        assert [entry["made"] for entry in told] == sorted((entry["made"] for entry in told), reverse=True)
    # The next studio of the folder knows them all.
    assert {entry.name for entry in Line(tmp_path, print).entries()} == {entry["name"] for entry in told}


def test_a_flood_is_told_to_come_later_and_does_no_harm(tmp_path, monkeypatch):
    with served_studio(tmp_path) as server:
        assert wanted(server, {"phrase": "a chair"})[0] == 200
        with ThreadPoolExecutor(100) as pool:
            flood = list(pool.map(lambda n: asked(server, "state" if n % 2 else f"said?phrase={n}"), range(400)))
        assert {status for status, _ in flood} <= {200, 503}
        assert [entry["name"] for entry in json.loads(asked(server, "state")[1])] == ["a-chair"]


def test_uploads_that_break_off_or_lie_leave_nothing(tmp_path):
    with served_studio(tmp_path) as server:
        for said, sent in ((1000, b"x" * 10), (1 << 40, b"x"), (-1, b"x")):
            with socket.create_connection(("127.0.0.1", server.server_port)) as raw:
                head = f"POST /{server.secret}/files/{group(1)}/a.png HTTP/1.1\r\nHost: 127.0.0.1\r\n"
                raw.sendall(f"{head}Origin: http://127.0.0.1\r\nContent-Length: {said}\r\n\r\n".encode() + sent)
        until(lambda: not files_in(tmp_path), "what came in part goes")
        for origin in ("http://evil.example", "null", "file://", "http://127.0.0.1.evil.example"):
            assert asked(server, f"files/{group(1)}/a.png", "POST", b"x", Origin=origin)[0] == 403
        for host in ("evil.example", "127.0.0.1.evil.example", "user@127.0.0.1"):
            assert asked(server, f"files/{group(1)}/a.png", "POST", b"x", Host=host)[0] == 403
        assert not files_in(tmp_path)


def test_a_large_file_goes_to_the_disk_as_it_comes(tmp_path, monkeypatch):
    """No part of it that is held is larger than the server's own pieces."""
    monkeypatch.setattr(serve, "MOST_FILE", 1 << 25)
    held: list[int] = []
    parts = serve._parts

    async def watched(request, most):
        async for part in parts(request, most):
            if isinstance(part, bytes):
                held.append(len(part))
            yield part

    monkeypatch.setattr(serve, "_parts", watched)
    with served_studio(tmp_path) as server:
        assert asked(server, f"files/{group(1)}/large.xyz", "POST", b"1 2 3\n" * 4_000_000)[0] == 200
        assert asked(server, f"files/{group(2)}/larger.xyz", "POST", b"1" * ((1 << 25) + 1))[0] == 413
    assert sum(held) - 24_000_000 < 1000
    assert max(held) < 1 << 20
    assert files_in(tmp_path) == {f"sources/{group(1)}/large.xyz"}


WRONG = {
    "empty.png": b"",
    "cut.png": png((200, 200))[:100],
    "text.jpg": b"this is a letter",
    "bomb.svg": BOMB.encode(),
    "path.svg": b'<svg xmlns="http://www.w3.org/2000/svg"><image href="file:///etc/passwd"/></svg>',
    "words.obj": b"v a b c\nf 1 2 3\n",
    "far.obj": b"v 0 0 0\nf 1 2 999999999999\n",
    "cut.stl": b"solid" + b"\0" * 75 + (1 << 31).to_bytes(4, "little"),
    "many.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nelement face 1\n"
    b"property list uchar int vertex_indices\nend_header\n",
    "cut.glb": b"glTF" + (2).to_bytes(4, "little") + (1 << 30).to_bytes(4, "little"),
    "outside.gltf": b'{"asset":{"version":"2.0"},"buffers":[{"uri":"../../../../etc/passwd","byteLength":9}]}',
    "deep.json": b"[" * 100_000,
    "other.json": b'{"points": "many"}',
    "words.step": b"ISO-10303-21;\nHEADER;\nADVANCED_FACE",
    "words.igs": b"nothing",
    "words.dxf": b"  0\nSECTION\n  2\nnothing",
    "words.3dm": b"3D Geometry File Format " + b"\0" * 40,
    "words.usda": b"#usda 1.0\ndef ",
    "cut.las": b"LASF" + b"\xff" * 300,
    "words.xyz": b"not one number\n",
    "letter.docx": b"PK\x03\x04",
    "up.zip": zipped({"../../up.png": png(), "b.png": png(), "c.png": png()}),
    "nothing.zip": b"PK\x05\x06" + b"\0" * 18,
    "one.zip": zipped({"part.obj": CUBE[:20]}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_wrong_files_end_in_a_sentence(tmp_path, name):
    out = tmp_path / "studio"
    with served_studio(out) as server:
        assert asked(server, f"files/{group(1)}/{name}", "POST", WRONG[name])[0] == 200
        status, answer = wanted(server, {"group": group(1)})
        if status == 200:
            with server.line as line:
                entry = line.entry(json.loads(answer)["name"])
                until(lambda: entry.state not in ("waiting", "running"), "it ends")
            assert entry.state == "failed"
            sentence = entry.message
        else:
            assert status == 400
            sentence = answer.decode()
        assert len(sentence) > 20, sentence
        assert "Traceback" not in sentence
        assert "process ended" not in sentence
        assert json.loads(asked(server, "state")[1]) is not None
    assert {path.split("/")[0] for path in files_in(tmp_path)} <= {"studio"}
    assert len(entries_in(out)) == (1 if status == 200 else 0)
