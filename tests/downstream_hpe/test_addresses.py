# SPDX-License-Identifier: MIT
"""Network cameras: a local server of HTTP and one of RTSP; those that do not answer, fall silent or end."""

from __future__ import annotations

import contextlib
import http.server
import io
import socket
import struct
import threading
import time
from pathlib import Path

import pytest
from clips import bars, make, rows_of
from PIL import Image

from downstream_hpe.errors import UsageError
from downstream_hpe.prediction import piped, video
from downstream_hpe.prediction.inputs import Source, find_sources, without_password
from downstream_hpe.prediction.kinds import Kind

pytest.importorskip("av")

SHORT_S = 1.0
PICTURES = ("/snapshot.jpg", "/locked.jpg", "/get?name=snapshot.jpg")
ADMIN = "Basic YWRtaW46c2UgY3JldA=="
"""Of admin, whose password is "se cret"."""


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    """MPEG-TS of 20 frames in two seconds."""
    folder = tmp_path_factory.mktemp("stream")
    return make(folder / "a.ts", "libx264", [bars(n) for n in range(20)]).read_bytes()


@pytest.fixture
def impatient(monkeypatch):
    for module in (video, piped):
        monkeypatch.setattr(module, "TIMEOUT_S", SHORT_S)


@pytest.fixture(scope="module")
def http_camera(stream):
    """Its address: whole files, streams that end, and one that falls silent."""
    picture, silent = io.BytesIO(), threading.Event()
    Image.fromarray(bars(20)).save(picture, "JPEG")
    exif, photo = Image.Exif(), io.BytesIO()
    exif[0x0112] = 6
    Image.fromarray(bars(20)).rotate(90).save(photo, "JPEG", exif=exif)

    class Camera(http.server.BaseHTTPRequestHandler):
        def log_message(self, *arguments):
            pass

        def do_GET(self):
            if self.path == "/around":
                self.send_response(302)
                self.send_header("Location", "/around")
                return self.end_headers()
            if self.path == "/locked.jpg" and self.headers.get("Authorization") != ADMIN:
                self.send_response(401)
                self.send_header("WWW-Authenticate", 'Basic realm="camera"')
                return self.end_headers()
            if self.path not in ("/whole.ts", "/live", "/silent", "/mjpeg", "/text", "/photo", *PICTURES):
                return self.send_error(404)
            self.send_response(200)
            if self.path == "/whole.ts":
                self.send_header("Content-Length", str(len(stream)))
            if self.path == "/mjpeg":
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=--frame")
            self.end_headers()
            content = {
                "/text": b"this is no video" * 99,
                **dict.fromkeys(PICTURES, picture.getvalue()),
                "/photo": photo.getvalue(),
                "/silent": stream[: len(stream) // 2],
                "/mjpeg": b"".join(
                    b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n%b\r\n"
                    % (len(picture.getvalue()), picture.getvalue())
                    for _ in range(6)
                ),
            }
            with contextlib.suppress(OSError):
                self.wfile.write(content.get(self.path, stream))
                self.wfile.flush()
                if self.path == "/silent":
                    silent.wait(20)

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Camera)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    silent.set()
    server.shutdown()
    server.server_close()


SDP = "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nt=0 0\r\nm=video 0 RTP/AVP 33\r\na=control:track0\r\n"


class RtspCamera(threading.Thread):
    """RTSP over TCP, which sends MPEG-TS in RTP packets (RFC 2250) once it is asked to play, and goes."""

    def __init__(self, content: bytes) -> None:
        super().__init__(daemon=True)
        self._content = content
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = f"rtsp://admin:secret@127.0.0.1:{self._listening.getsockname()[1]}/live"

    def run(self) -> None:
        client, _ = self._listening.accept()
        with client, client.makefile("rb") as asked:
            while line := asked.readline().decode():
                headers = {}
                while (one := asked.readline().decode().strip()) != "":
                    name, _, value = one.partition(": ")
                    headers[name.lower()] = value
                method = line.split()[0]
                answer = [f"RTSP/1.0 200 OK\r\nCSeq: {headers['cseq']}\r\nSession: 1"]
                body = ""
                if method == "OPTIONS":
                    answer.append("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN")
                if method == "DESCRIBE":
                    body = SDP
                    answer += ["Content-Type: application/sdp", f"Content-Length: {len(body)}"]
                if method == "SETUP":
                    answer.append("Transport: RTP/AVP/TCP;unicast;interleaved=0-1")
                client.sendall(("\r\n".join(answer) + "\r\n\r\n" + body).encode())
                if method == "PLAY":
                    break
            for number, start in enumerate(range(0, len(self._content), 7 * 188)):
                packet = struct.pack("!BBHII", 0x80, 33, number, number * 900, 1)
                packet += self._content[start : start + 7 * 188]
                client.sendall(struct.pack("!cBH", b"$", 0, len(packet)) + packet)
            time.sleep(0.2)

    def close(self) -> None:
        self._listening.close()


def test_a_camera_of_rtsp(stream):
    camera = RtspCamera(stream)
    camera.start()
    rows, (note,) = rows_of(camera.address)
    camera.close()
    assert 15 <= len(rows) <= 20 and all(row["found"] for row in rows)
    assert {row["input"] for row in rows} == {camera.address.replace("secret", "***")}
    assert rows[0]["time_s"] == 0 and rows[-1]["time_s"] == pytest.approx(0.1 * (len(rows) - 1), abs=0.15)
    assert "secret" not in note and ("ended after 1." in note or "broke off after 1." in note)


def test_what_lies_on_a_server(http_camera):
    rows, notes = rows_of(f"{http_camera}/whole.ts")
    assert len(rows) == 20 and notes == [] and rows[-1]["time_s"] == pytest.approx(1.9)
    (row,), notes = rows_of(f"{http_camera}/snapshot.jpg")
    assert row["found"] and row["frame"] is None and notes == []
    # A picture whose address does not end as one, with EXIF, which PyAV does not know.
    (row,), _ = rows_of(f"{http_camera}/photo")
    assert row["found"] and row["frame"] == 0
    (row,), notes = rows_of(f"{http_camera}/get?name=snapshot.jpg")
    assert row["found"] and row["frame"] is None and notes == []
    locked = f"{http_camera}/locked.jpg".replace("//", "//admin:se%20cret@")
    (row,), notes = rows_of(locked)
    assert row["found"] and "se%20cret" not in row["input"] and notes == []
    rows, _ = rows_of(f"{http_camera}/mjpeg", frames=4)
    assert [row["frame"] for row in rows] == [0, 1, 2, 3] and all(row["found"] for row in rows)


def test_a_stream_that_ends_says_so(http_camera):
    rows, (note,) = rows_of(f"{http_camera}/live")
    assert len(rows) == 20
    assert (
        note == f"{http_camera}/live: broke off after 1.90 s (the connection ended); what there was is kept"
    )
    assert rows_of(f"{http_camera}/live", frames=20)[1] == []


def test_a_stream_that_falls_silent_is_not_waited_for(http_camera, impatient):
    rows, (note,) = rows_of(f"{http_camera}/silent")
    assert rows and "broke off after" in note and "nothing came for 1 s" in note


@pytest.mark.parametrize("where", ["http://{}/a.ts", "http://{}/a.jpg", "rtsp://{}/a"])
def test_an_address_that_does_not_answer(where, impatient):
    with socket.create_server(("127.0.0.1", 0)) as mute:
        address = where.format(f"127.0.0.1:{mute.getsockname()[1]}")
        rows, notes = rows_of(address)
    assert not rows and notes == [f"{address}: does not answer within 1 s"]


def test_addresses_with_nothing_to_see(http_camera):
    for name, says in (
        ("/text", "cannot be opened as video"),
        ("/none", "cannot be opened as video (Server returned 404 Not Found)"),
        ("/none.jpg", "there is no picture (404 Not Found)"),
        ("/locked.jpg", "there is no picture (401 Unauthorized)"),
        ("/around", "cannot be opened as video"),
        ("/a b.jpg", "cannot be read (InvalidURL)"),
    ):
        rows, (note,) = rows_of(http_camera + name)
        assert not rows and note.startswith(f"{http_camera}{name}: {says}")
    for name in ("http://nohost.invalid/a.jpg", "rtsp://user:secret@nohost.invalid/a"):
        rows, (note,) = rows_of(name)
        assert not rows and note.endswith(
            "nohost.invalid/a" + ".jpg" * ("jpg" in name) + ": there is no such host, or no network"
        )
        assert "secret" not in note


def test_what_is_an_address():
    assert find_sources(["rtsp://camera/live"]) == [Source("rtsp://camera/live", Kind.VIDEO)]
    for bad in ("ftp://a/b.mp4", "http://", "file:///etc/passwd", "rtsp://camera:port/"):
        with pytest.raises(UsageError, match="expected an address"):
            find_sources([bad])
    assert without_password("http://a:b@c/d@e") == "http://a:***@c/d@e"
    assert without_password("http://c/d@e") == "http://c/d@e"
    (source,) = find_sources(["http://camera:8080/live.cgi?x=/y"], Path("drawn"))
    assert source.copy == Path("drawn/live.cgi.mp4")
