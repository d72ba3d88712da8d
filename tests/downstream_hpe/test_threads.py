# SPDX-License-Identifier: MIT
"""One Predictor in many threads and in other processes."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from downstream_hpe import Predictor
from downstream_hpe.errors import DataError
from downstream_hpe.prediction.landmarker_pool import LandmarkerPool
from downstream_hpe.prediction.landmarkers import FORKED
from litert_faces.crop import LONGEST
from litert_faces.quiet import silence

MODULES = {"mediapipe": "mediapipe", "litert": "ai_edge_litert"}


class Slow:
    """Answers with how many threads are inside it."""

    def __init__(self) -> None:
        self.inside, self.closed = 0, False

    def look(self) -> int:
        self.inside += 1
        threading.Event().wait(0.01)
        found, self.inside = self.inside, self.inside - 1
        return found

    def close(self) -> None:
        self.closed = True


def test_no_two_threads_share_a_landmarker(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    made: list[Slow] = []
    pool = LandmarkerPool(lambda: made.append(Slow()) or made[-1])

    def look(_: int) -> int:
        with pool.one() as landmarker:
            return landmarker.look()

    for _ in range(3):
        assert look(0) == 1
    assert len(made) == 1  # one thread has one
    with ThreadPoolExecutor(8) as threads:
        assert set(threads.map(look, range(40))) == {1}
    assert 1 < len(made) <= 3
    pool.close()
    assert all(one.closed for one in made)
    assert look(0) == 1 and not made[-1].closed


def test_a_landmarker_that_cannot_be_made_leaves_its_place(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    pool = LandmarkerPool(lambda: int("none"))
    for _ in range(3):  # the third would wait for ever
        with pytest.raises(ValueError), pool.one():
            pass


def test_stderr_comes_back_whatever_the_order_of_threads():
    before, inside, leave = os.fstat(2), threading.Event(), threading.Event()

    def longer() -> None:
        with silence():
            inside.set()
            leave.wait()

    other = threading.Thread(target=longer)
    with silence():
        other.start()
        inside.wait()
    assert os.fstat(2) != before
    leave.set()
    other.join()
    assert os.fstat(2).st_ino == before.st_ino
    # In a child the other thread is not there to put it back.
    with silence():
        child = os.fork()
        if not child:
            os._exit(os.fstat(2).st_ino != before.st_ino)
        assert os.waitpid(child, 0)[1] == 0


@pytest.fixture(scope="module")
def pictures():
    """The astronaut's portrait at several sizes and places, and one without a face."""
    portrait = pytest.importorskip("skimage.data").astronaut()
    cut = [np.ascontiguousarray(portrait[k : k + 320, 60 + 2 * k : 420]) for k in range(0, 50, 10)]
    return [*cut, portrait, np.full((200, 300, 3), 120, np.uint8)]


@pytest.mark.slow
@pytest.mark.parametrize("detector", MODULES)
def test_threads_find_what_one_alone_does(detector, pictures):
    pytest.importorskip(MODULES[detector])
    with Predictor(detector=detector) as predictor:
        alone = [predictor.predict(picture, faces=2) for picture in pictures]
    assert [pose is None for pose in alone] == [False] * 6 + [True]
    # As it is opened by all at once, too.
    with Predictor(detector=detector) as predictor, ThreadPoolExecutor(6) as threads:
        together = list(threads.map(lambda picture: predictor.predict(picture, faces=2), 4 * pictures))
    assert together == 4 * alone


@pytest.mark.slow
@pytest.mark.parametrize("detector", MODULES)
def test_sizes_that_no_detector_was_made_for(detector):
    """MediaPipe's OpenCV ends the program where a line is too long for it."""
    pytest.importorskip(MODULES[detector])
    with Predictor(detector=detector) as predictor:
        for shape in ((1, 1), (1, 5000), (5000, 1), (3, LONGEST)):
            assert predictor.predict(np.zeros(shape, np.uint8)) is None
        for shape in ((3, LONGEST + 1), (LONGEST + 1, 3)):
            with pytest.raises(DataError, match="pixels, more than 32,766 in a line"):
                predictor.predict(np.zeros(shape, np.uint8))


PROGRAM = """
import multiprocessing, sys
from downstream_hpe import HpeError, Predictor

PREDICTOR = Predictor(detector=sys.argv[1])

def inherited(file):
    return PREDICTOR.predict(file)

def said(pool, look, file, expected):
    try:
        return pool.apply_async(look, (file,)).get(60) == expected
    except HpeError as error:
        return error

if __name__ == "__main__":
    for file in sys.argv[2:]:  # first while this process has opened no detector, then after it has
        expected = None
        for how in ("fork", "spawn"):
            if expected is None and file != sys.argv[2]:
                expected = PREDICTOR.predict(file)
            with multiprocessing.get_context(how).Pool(1) as pool:
                found = pool.apply(PREDICTOR.predict, (file,)) if expected is None else expected
                print(how, said(pool, PREDICTOR.predict, file, found), said(pool, inherited, file, found))
"""


@pytest.mark.slow
@pytest.mark.parametrize("detector", MODULES)
def test_processes_find_the_same_or_say_why_not(detector, pictures, tmp_path):
    pytest.importorskip(MODULES[detector])
    (tmp_path / "program.py").write_text(PROGRAM)
    Image.fromarray(pictures[0]).save(tmp_path / "p.png")
    Image.fromarray(pictures[1]).save(tmp_path / "q.png")
    command = [sys.executable, "program.py", detector, "p.png", "q.png"]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=200)
    after = f"{FORKED} {FORKED}" if detector == "mediapipe" else "True True"
    assert done.stdout.splitlines() == [
        "fork True True",
        "spawn True True",
        f"fork {after}",
        "spawn True True",
    ], done.stderr[-2000:]
