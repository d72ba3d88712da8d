# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of `downstream-hpe demo` in a browser: Python's angles, and a line for whatever goes wrong."""

from __future__ import annotations

import base64
import io
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from PIL import Image
from placed_head import PlacedHead

from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.tracks import FaceTracks
from downstream_hpe.prediction.way_up import WayUp
from generator.execution.lanes.renderer import Renderer

pytestmark = pytest.mark.slow

POSES = [(0.0, 0.0, 0.0), (30.0, 10.0, 0.0), (-20.0, -15.0, 20.0)]
WIDTH, HEIGHT = 640, 480
TOLERANCE_DEG = 0.1
CAMERA_RATE, REPEATED = 10, 6
"""Of the stand-in for a camera: frames a second, and how many in a row show one pose."""
READY = "document.body?.dataset.state === 'ready'"
TROUBLE = "(document.getElementById('trouble').hidden ? '' : document.getElementById('trouble').textContent)"
SEEN = """JSON.stringify([document.getElementById("numbers").dataset.pose,
  document.getElementById("picture").toDataURL("image/png")])"""


REFUSED = """new Promise((resolve) => {{
  const violated = ({{ effectiveDirective }}) => resolve(effectiveDirective);
  document.addEventListener("securitypolicyviolation", violated, {{ once: true }});
  fetch("{}").then(() => resolve(null), () => setTimeout(resolve, 1000, "not connected"));
}})"""
"""Which rule of the page's policy keeps it from an address; null: none."""
KEEP_STREAM = """(() => {
  const devices = navigator.mediaDevices, open = devices.getUserMedia.bind(devices);
  devices.getUserMedia = async (wanted) => (window.stream = await open(wanted));
})()"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The page, served as a person would have it served, until Ctrl-C."""
    command = [sys.executable, "-m", "downstream_hpe.cli", "demo", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as server:
        line = server.stdout.readline()
        assert line, server.stderr.read()
        yield json.loads(line)["url"]
        server.send_signal(signal.SIGINT)
        assert server.wait(timeout=100) == 0


@pytest.fixture(scope="module")
def browser(address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """The page, open, on a machine without a camera."""
    with Browser(tmp_path_factory.mktemp("browser")) as browser:
        open_page(browser, address)
        yield browser
        assert_local(browser, address)


@pytest.fixture(scope="module")
def predictor() -> Iterator[Predictor]:
    predictor = Predictor.load()
    yield predictor
    predictor.close()


@pytest.fixture(scope="module")
def renders(
    placed_head: PlacedHead, renderer: Renderer, tmp_path_factory: pytest.TempPathFactory
) -> list[np.ndarray]:
    """Frames of a camera, BGR, uint8 [480, 640, 3], with a parametric head at POSES."""
    from generator.heads.package import save_package
    from generator.plan.config import BuildConfig
    from generator.plan.settings import Render
    from generator.plan.view_plan import plan_views

    package = tmp_path_factory.mktemp("head") / "head.npz"
    save_package(placed_head.mesh, package)
    look = BuildConfig(render=Render(resolution=360, lens_mm=85.0, samples=4))
    views = plan_views(look, "a/neutral", placed_head.placement.radius_mm, POSES)
    frames = []
    for path in renderer.render(package, views):
        frame = np.full((HEIGHT, WIDTH, 3), 90, dtype=np.uint8)
        frame[60:420, 140:500] = read_bgr(path)
        frames.append(frame)
    return frames


def poses_of(predictor: Predictor, bgr: np.ndarray) -> np.ndarray:
    """Yaw, pitch, roll and confidence that Python has of a picture."""
    pose = predictor.from_image(bgr)
    assert pose is not None
    return np.append(pose.ypr_deg[0], pose.confidence)


def open_page(browser: Browser, address: str) -> None:
    browser.open(address)
    browser.wait(f"{READY} && document.readyState === 'complete'")


def shown(browser: Browser, file: Path, dropped: bool = False) -> np.ndarray | None:
    """What the page says of a picture, chosen or dropped; None: no face."""
    if dropped:
        browser.drop(file)
    else:
        browser.choose("#file", file)
    name = json.dumps(file.name)
    browser.wait(f"{READY} && document.getElementById('status').textContent.startsWith({name})")
    assert browser.run(TROUBLE) == ""
    said = browser.run("document.getElementById('numbers').dataset.pose")
    return np.array(json.loads(said)) if said else None


def seen(browser: Browser) -> tuple[np.ndarray, np.ndarray]:
    """Pose and pixels, BGR, of the frame that is on the page."""
    pose, picture = json.loads(browser.run(SEEN))
    return np.array(json.loads(pose)), pixels_of(picture)


def pixels_of(picture: str) -> np.ndarray:
    """BGR, uint8 [H, W, 3], of an address that holds a PNG."""
    image = Image.open(io.BytesIO(base64.b64decode(picture.partition(",")[2])))
    return np.asarray(image.convert("RGB"))[..., ::-1]


def nearest(pixels: np.ndarray, frames: list[np.ndarray]) -> int:
    """Which of the frames this is."""
    return int(np.argmin([np.abs(pixels - frame.astype(int)).mean() for frame in frames]))


def assert_fits(browser: Browser, folder: Path) -> None:
    """Nothing sticks out, be it wide or narrow; screenshots are kept."""
    for width in (390, 1280):
        browser.resize(width, 900)
        browser.wait(f"innerWidth === {width} && document.documentElement.scrollWidth <= innerWidth", 200)
        browser.screenshot(folder / f"{width}.png")


def assert_local(browser: Browser, address: str) -> None:
    """Nothing was asked of anybody else, and nothing was sent."""
    assert browser.requests
    local = (address, f"blob:{address}", "about:")
    assert not [url for url in browser.requests if not url.startswith(local)]
    assert not [line for line in browser.console if "Content Security Policy" in line or "exception" in line]


def test_pictures_have_the_angles_of_python(browser, predictor, renders, tmp_path):
    astronaut = pytest.importorskip("skimage.data").astronaut()
    large = np.full((1500, 2400, 3), 120, dtype=np.uint8)
    large[700:1180, 1500:2140] = renders[1]  # a face of a tenth of it
    pictures = {
        "turned.png": renders[1],
        "both.png": renders[2],
        "over.png": renders[0][::-1, ::-1],
        "side.png": np.rot90(renders[1]),
        "large.png": large,
        "photograph.jpg": astronaut[..., ::-1],
        "small.png": renders[0][::3, ::3],
    }
    for name, bgr in pictures.items():
        path = tmp_path / name
        Image.fromarray(np.ascontiguousarray(bgr[..., ::-1])).save(path, quality=95)
        expected = poses_of(predictor, read_bgr(path))
        found = shown(browser, path)
        assert found is not None, name
        np.testing.assert_allclose(found[:3], expected[:3], atol=TOLERANCE_DEG, err_msg=name)
        assert found[3] == pytest.approx(expected[3], abs=0.005), name
    assert_fits(browser, tmp_path)
    Image.new("RGB", (300, 200), (90, 120, 90)).save(tmp_path / "meadow.png")
    assert shown(browser, tmp_path / "meadow.png", dropped=True) is None
    assert browser.run("document.getElementById('word').textContent") == "No face found."


def i420(bgr: np.ndarray) -> bytes:
    """As cameras send it: brightness of every pixel, colours of every fourth."""
    cv2 = pytest.importorskip("cv2")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420).tobytes()


def write_camera(path: Path, frames: list[np.ndarray]) -> None:
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{WIDTH} H{HEIGHT} F{CAMERA_RATE}:1 Ip A1:1 C420jpeg\n".encode())
        for frame in frames:
            file.write((b"FRAME\n" + i420(frame)) * REPEATED)


def test_a_camera_has_the_angles_of_python_frame_by_frame(address, predictor, renders, tmp_path):
    cv2 = pytest.importorskip("cv2")
    write_camera(tmp_path / "camera.y4m", renders)
    sent = [np.frombuffer(i420(frame), np.uint8).reshape(-1, WIDTH) for frame in renders]
    expected = [poses_of(predictor, cv2.cvtColor(one, cv2.COLOR_YUV2BGR_I420)) for one in sent]
    flags = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
    with Browser(tmp_path, *flags, f"--use-file-for-fake-video-capture={tmp_path / 'camera.y4m'}") as browser:
        open_page(browser, address)
        browser.run(KEEP_STREAM)
        browser.run("document.getElementById('camera').click()")
        missing = {0, 1, 2}
        while missing:
            browser.wait("document.getElementById('numbers').dataset.pose")
            pose, pixels = seen(browser)
            assert pixels.shape == (HEIGHT, WIDTH, 3)
            which = nearest(pixels, renders)
            if which not in missing:
                continue
            missing.remove(which)
            # The very pixels that the page had, and those that the camera sent, rounded on the way.
            here = poses_of(predictor, pixels)
            np.testing.assert_allclose(pose[:3], here[:3], atol=TOLERANCE_DEG)
            np.testing.assert_allclose(pose[:3], expected[which][:3], atol=2 * TOLERANCE_DEG)
            assert pose[3] == pytest.approx(here[3], abs=0.005)
        assert_fits(browser, tmp_path)
        mirrored = """["picture", "axes", "head"].every((id) =>
            getComputedStyle(document.getElementById(id)).transform.startsWith("matrix(-1"))"""
        assert browser.run(mirrored)
        browser.run("document.getElementById('mirror').click()")
        assert not browser.run(mirrored)
        browser.run("document.getElementById('stop').click()")
        assert browser.run("document.getElementById('status').textContent") == "Stopped."
        assert browser.run("stream.getVideoTracks()[0].readyState") == "ended", "the camera is let go"
        browser.run("document.getElementById('camera').click()")
        browser.wait("document.body.dataset.state === 'playing'")
        browser.run("stream.getVideoTracks()[0].dispatchEvent(new Event('ended'))")
        assert browser.run(TROUBLE) == "The camera has stopped: it was unplugged, or the system took it."
        assert browser.run(READY) and browser.run("document.getElementById('stop').hidden")
        assert_local(browser, address)


def write_video(path: Path, code: str, frames: list[np.ndarray], seconds_each: int = 1) -> None:
    cv2 = pytest.importorskip("cv2")
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), 10.0, (WIDTH, HEIGHT))
    assert writer.isOpened()
    for frame in frames:
        for _ in range(10 * seconds_each):
            writer.write(frame)
    writer.release()


def test_a_video_has_the_angles_of_python_and_may_be_wound_back(browser, predictor, renders, tmp_path):
    write_video(tmp_path / "clip.webm", "VP80", renders)
    browser.choose("#file", tmp_path / "clip.webm")
    browser.wait("document.getElementById('pause').textContent === 'Again'")
    time = "document.getElementById('time')"
    for n, time_s in ((0, 0.5), (1, 1.5), (2, 2.5)):
        browser.run(f"{time}.value = {time_s}, {time}.dispatchEvent(new Event('input'))")
        for _ in range(100):
            pose, pixels = seen(browser)
            if nearest(pixels, renders) == n:
                break
        else:
            pytest.fail(f"the page stays at another frame than that of {time_s} s")
        np.testing.assert_allclose(pose[:3], poses_of(predictor, pixels)[:3], atol=TOLERANCE_DEG)


def test_a_video_that_is_upside_down_is_looked_at_as_python_does(browser, predictor, renders, tmp_path):
    # longer than the patience after a first frame without a face, which a slow machine may show
    write_video(tmp_path / "over.webm", "VP80", [renders[0][::-1, ::-1]], seconds_each=3)
    browser.choose("#file", tmp_path / "over.webm")
    playing = "document.getElementById('status').textContent.startsWith('over.webm: playing')"
    browser.wait(f"{playing} && document.getElementById('pause').textContent === 'Again'")
    pose, pixels = seen(browser)
    way_up = WayUp()
    for time_s in (0.0, 0.1):
        landmarks = way_up.faces(predictor, pixels, 1, time_s)
    assert way_up.quarter == 2
    expected = predictor.from_landmarks(landmarks).ypr_deg[0]
    np.testing.assert_allclose(pose[:3], expected, atol=TOLERANCE_DEG)
    assert abs(pose[2]) > 150


LOG = """(() => {
  const numbers = document.getElementById("numbers");
  const add = () => log.push([numbers.dataset.time, numbers.dataset.pose,
    document.getElementById("picture").toDataURL("image/png")]);
  window.log = [];
  new MutationObserver(add).observe(numbers, { attributeFilter: ["data-pose"] });
})()"""
"""Keeps what the page shows, frame by frame."""


def test_a_video_is_smoothed_as_python_does(browser, predictor, renders, tmp_path):
    write_video(tmp_path / "turns.webm", "VP80", renders[:2])
    browser.run(LOG)
    browser.run("document.getElementById('smooth').click()")
    browser.choose("#file", tmp_path / "turns.webm")
    playing = "document.getElementById('status').textContent.startsWith('turns.webm: playing')"
    browser.wait(f"{playing} && document.getElementById('pause').textContent === 'Again'")
    browser.screenshot(tmp_path / "smooth.png")
    way_up, tracks, off, last_s = WayUp(), FaceTracks(smooth=True), [], -1.0
    for time, pose, picture in json.loads(browser.run("JSON.stringify(log)")):
        if not time or not pose or float(time) <= last_s:
            continue
        last_s = float(time)
        found = way_up.faces(predictor, pixels_of(picture), 1, last_s)
        raw = predictor.from_landmarks(found)
        (index,) = tracks.indices(found, last_s)
        expected = angles_from_rotation(tracks.steady(index, raw.rotation[0].astype(np.float64), last_s))
        np.testing.assert_allclose(json.loads(pose)[:3], expected, atol=TOLERANCE_DEG)
        off.append(np.abs(expected - raw.ypr_deg[0]).max())
    assert len(off) > 5 and max(off) > 3  # behind, where the head turns at once
    browser.run("document.getElementById('smooth').click()")


def test_what_cannot_be_read_is_said_in_one_line(browser, tmp_path):
    (tmp_path / "text.jpg").write_text("no picture")
    (tmp_path / "empty.png").write_bytes(b"")
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "notes.txt").write_text("neither")
    Image.new("1", (20000, 10000)).save(tmp_path / "huge.png")
    whole = io.BytesIO()
    Image.effect_noise((300, 300), 50).save(whole, "PNG")
    (tmp_path / "cut.png").write_bytes(whole.getvalue()[:20])
    write_video(tmp_path / "old.avi", "MJPG", [np.zeros((HEIGHT, WIDTH, 3), np.uint8)])
    unplayable = "this browser cannot play it: it is no video, damaged, or of a codec that it lacks."
    expected = {
        "text.jpg": "text.jpg: not a picture that this browser can read.",
        "empty.png": "empty.png: an empty file, no picture and no video.",
        "cut.png": "cut.png: not a picture that this browser can read.",
        "text.mp4": f"text.mp4: {unplayable}",
        "old.avi": f"old.avi: {unplayable}",
        "notes.txt": "notes.txt: neither a picture nor a video that this browser can read.",
        "huge.png": "huge.png: 20000 x 10000 pixels, more than 67 megapixels: make it smaller.",
    }
    for name, line in expected.items():
        browser.choose("#file", tmp_path / name)
        assert browser.wait(f"{READY} && {TROUBLE}.startsWith({json.dumps(name)}) && {TROUBLE}") == line
    browser.run("document.getElementById('camera').click()")
    said = browser.wait(f"{READY} && !{TROUBLE}.startsWith('huge') && {TROUBLE}")
    assert said == "No camera was found: connect one, or open a picture or a video."
    for error, beginning in (
        ("NotReadableError", "The camera cannot be used: another program has it"),
        ("NotAllowedError", "The camera was refused: allow it for this page"),
        ("WhateverError", "The camera did not start (WhateverError: why)"),
    ):
        refuse = f"async () => {{ throw new DOMException('why', '{error}') }}"
        browser.run(f"navigator.mediaDevices.getUserMedia = {refuse}, 0")
        browser.run("document.getElementById('camera').click()")
        browser.wait(f"{READY} && {TROUBLE}.startsWith({json.dumps(beginning)})")
    assert browser.run("document.getElementById('numbers').dataset.state") == "none"


def test_with_less_than_a_browser_has_it_is_said_and_what_can_works(address, predictor, renders, tmp_path):
    flags = ("--disable-3d-apis", "--use-fake-device-for-media-stream", "--deny-permission-prompts")
    Image.fromarray(np.ascontiguousarray(renders[0][..., ::-1])).save(tmp_path / "a.png")
    with Browser(tmp_path, *flags) as browser:
        open_page(browser, address)
        assert browser.run("document.createElement('canvas').getContext('webgl')") is None
        found = shown(browser, tmp_path / "a.png")
        np.testing.assert_allclose(found[:3], poses_of(predictor, renders[0])[:3], atol=TOLERANCE_DEG)
        browser.run("document.getElementById('camera').click()")
        browser.wait(f"{READY} && {TROUBLE}.startsWith('The camera was refused: allow it for this page')")
        refused = browser.run(REFUSED.format(f"{address}model/facts.json"))
        assert refused is None, "its own files it may read"
        assert browser.run(REFUSED.format("http://127.0.0.1:9/")) == "connect-src"
        browser.order("Page.addScriptToEvaluateOnNewDocument", source="delete globalThis.WebAssembly")
        browser.open(address)
        browser.wait("document.body?.dataset.state === 'failed'")
        assert browser.run(TROUBLE).startswith("This browser has no WebAssembly, in which the networks run")
        assert browser.run("document.getElementById('camera').disabled")
