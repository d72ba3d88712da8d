# SPDX-License-Identifier: MIT
"""Pictures a second from a folder and from a video, what takes the time, and whether memory stays flat.

    python benchmarks/predict.py [--quick] [--pictures 2000] [--detector mediapipe --detector litert]

Pictures and videos are made of the portraits that scikit-image and matplotlib carry: cut out, turned and
mirrored. They are looked at as `downstream-hpe predict` does it, by turns with a loop over plain MediaPipe
that stops at the landmarks and estimates no pose: FaceMesh on each picture on its own, and on videos also as
it is made for them, following the face. Of each picture its quickest round counts, since machines are
shared; CPU is what all threads took. Then threads that share one Predictor; and a process that looks at
--pictures pictures, one after the other, with its memory in the first and in the last quarter of them. Exit
code 1 where that has grown by more than a tenth.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.util import find_spec
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import psutil
from PIL import Image

from downstream_hpe import Camera, Pose, Predictor
from downstream_hpe.prediction.inputs import find_sources
from downstream_hpe.prediction.landmarkers import MediaPipe
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.predictions import predictions

CARRIED = {
    ("skimage", "data/astronaut.png"): (225, 120, 210),
    ("matplotlib", "mpl-data/sample_data/grace_hopper.jpg"): (255, 170, 300),
}
"""Portraits, and where their faces are: x, y and about how wide with hair, pixels."""
SIZES = {"pictures of 640 x 640": (640, 640, 24), "pictures of 4000 x 3000": (4000, 3000, 2)}
"""Width and height of the pictures of a folder, and how many there are."""
VIDEOS = {"video of 640 x 480": (640, 480), "video of 1920 x 1080": (1920, 1080)}
DETECTORS = ("mediapipe", "litert")
PARTS = ("detector", "pose", "graph")
PLAIN = "plain MediaPipe"
GROWTH = 1.1
HEADER = """\
| of | by | with a face | a second | beside plain | CPU ms | ms each | the rest | detector | pose | graph |
| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""


class Timed(Predictor):
    """seconds: what was spent in its parts; the pose holds the graph."""

    def __init__(self, detector: str) -> None:
        super().__init__(detector=detector)
        self.seconds = dict.fromkeys(PARTS, 0.0)

    def _timed(self, part: str, call: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        found = call()
        self.seconds[part] += time.perf_counter() - start
        return found

    def faces(self, bgr: np.ndarray, limit: int = 1, turned: bool = True) -> np.ndarray:
        return self._timed("detector", lambda: super(Timed, self).faces(bgr, limit, turned))

    def from_landmarks(self, landmarks: np.ndarray, camera: Camera | None = None) -> Pose:
        return self._timed("pose", lambda: super(Timed, self).from_landmarks(landmarks, camera))

    def graph(self, points: np.ndarray) -> dict[str, np.ndarray]:
        return self._timed("graph", lambda: super(Timed, self).graph(points))


def ours(predictor: Predictor, place: Path) -> Iterator[int]:
    """Whether there is a face, picture by picture, as downstream-hpe predict finds it."""
    return (row["found"] for row in predictions(find_sources([str(place)]), predictor))


def plain(mesh: Any, place: Path) -> Iterator[int]:
    """The same of plain MediaPipe: landmarks, and nothing made of them."""
    images = frames(place) if place.is_file() else map(read_rgb, sorted(place.iterdir()))
    return (mesh.process(image).multi_face_landmarks is not None for image in images)


def frames(video: Path) -> Iterator[np.ndarray]:
    capture = cv2.VideoCapture(str(video))
    while True:
        whole, frame = capture.read()
        if not whole:
            return
        yield cv2.cvtColor(frame, cv2.COLOR_BGR2RGB)


def read_rgb(file: Path) -> np.ndarray:
    return np.ascontiguousarray(read_bgr(file)[..., ::-1])


def face_mesh(follows: bool) -> Any:
    from mediapipe.python.solutions.face_mesh import FaceMesh

    return FaceMesh(static_image_mode=not follows, max_num_faces=1)


def portraits() -> list[tuple[Image.Image, tuple[int, int, int]]]:
    found = []
    for (package, file), place in CARRIED.items():
        spec = find_spec(package)
        for folder in (spec and spec.submodule_search_locations) or ():
            found.append((Image.open(Path(folder) / file).convert("RGB"), place))
    if not found:
        sys.exit("predict.py: neither scikit-image nor matplotlib is installed, whose portraits it looks at")
    return found


def cut(n: int, width: int, height: int, rng: np.random.Generator) -> Image.Image:
    """A face in a picture of that size, a third to a half of its shorter side, somewhere in it."""
    every = portraits()
    picture, (x, y, face) = every[n % len(every)]
    scale = rng.uniform(0.33, 0.5) * min(width, height) / face
    # From pixels of the cut to pixels of the portrait: about the face, turned a little.
    angle, (u, v) = np.deg2rad(rng.uniform(-15, 15)), rng.uniform(0.35, 0.65, 2) * (width, height)
    a, b = np.cos(angle) / scale, np.sin(angle) / scale
    matrix = (a, -b, x - a * u + b * v, b, a, y - b * u - a * v)
    image = picture.transform(
        (width, height), Image.Transform.AFFINE, matrix, Image.Resampling.BICUBIC, fillcolor=(120, 125, 130)
    )
    return image.transpose(Image.Transpose.FLIP_LEFT_RIGHT) if n % 4 > 1 else image


def write_inputs(folder: Path, frame_count: int) -> dict[str, Path]:
    """By name: folders of pictures and videos."""
    rng = np.random.default_rng(16)
    places = {}
    for k, (name, (width, height, count)) in enumerate(SIZES.items()):
        places[name] = folder / f"pictures{k}"
        places[name].mkdir()
        for n in range(count):
            cut(n, width, height, rng).save(places[name] / f"{n:03}.jpg", quality=92)
    for k, (name, (width, height)) in enumerate(VIDEOS.items()):
        places[name] = folder / f"video{k}.mp4"
        whole = np.asarray(cut(0, width + frame_count, height, rng))[..., ::-1]
        code = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(places[name]), code, 25.0, (width, height))
        for n in range(frame_count):  # a camera that pans
            writer.write(np.ascontiguousarray(whole[:, n : n + width]))
        writer.release()
    return places


class Way:
    """One of those that are compared. look: whether there is a face, picture by picture; parts: seconds that
    it counts itself."""

    def __init__(self, look: Callable[[], Iterator[int]], parts: dict[str, float]) -> None:
        self._look, self._parts = look, parts
        self._rounds: list[np.ndarray] = []
        self.faces = self.looks = 0

    def round(self) -> None:
        """Wall time, CPU time and parts of every picture."""
        self.faces, times = 0, [self._now()]
        for found in self._look():
            self.faces += found
            times.append(self._now())
        self._rounds.append(np.diff(times, axis=0))
        self.looks = len(self._rounds[0])

    def _now(self) -> list[float]:
        return [time.perf_counter(), time.process_time(), *self._parts.values()]

    def seconds(self) -> np.ndarray:
        """Wall, CPU, parts: of each picture in its quickest round; the first opens what is needed."""
        rounds = np.stack(self._rounds[1:])
        quickest = rounds[..., 0].argmin(axis=0)
        return np.asarray(rounds[quickest, np.arange(rounds.shape[1])].sum(axis=0))

    def cells(self, plain_rate: float) -> list[str]:
        """Of the table, from its third on."""
        wall, cpu, *parts = self.seconds() / self.looks
        found = [f"{self.faces} of {self.looks}", f"{1 / wall:.1f}", f"{1 / wall / plain_rate:.2f}"]
        found += [f"{1e3 * cpu:.1f}", f"{1e3 * wall:.1f}"]
        rest = [wall - parts[0] - parts[1], *parts] if parts else []
        return [*found, *(f"{1e3 * part:.2f} ({part / wall:.1%})" for part in rest), *[""] * (4 - len(rest))]


def compare(name: str, place: Path, detectors: list[str], rounds: int) -> None:
    """Rows of the table, by turns."""
    meshes = {PLAIN: face_mesh(False)}
    if place.is_file():
        meshes[f"{PLAIN}, following the face"] = face_mesh(True)
    ways = {text: Way(partial(plain, mesh, place), {}) for text, mesh in meshes.items()}
    predictors = [Timed(detector) for detector in detectors]
    for detector, predictor in zip(detectors, predictors, strict=True):
        ways[f"predict, {detector}"] = Way(partial(ours, predictor, place), predictor.seconds)
    for _ in range(1 + rounds):
        for way in ways.values():
            way.round()
    rate = ways[PLAIN].looks / ways[PLAIN].seconds()[0]
    for text, way in ways.items():
        print("|", " | ".join([name, text, *way.cells(rate)]), "|", flush=True)
    for predictor in predictors:
        predictor.close()


def with_threads(folder: Path, detectors: list[str], rounds: int) -> None:
    """Threads that share a Predictor, by turns with one alone."""
    cores, files = os.cpu_count() or 1, 4 * sorted(folder.iterdir())
    for detector in detectors:
        best = {1: np.inf, cores: np.inf}
        with Predictor(detector=detector) as predictor, ThreadPoolExecutor(cores) as every:
            list(every.map(predictor.predict, files[: 2 * cores]))  # opens what is needed
            for _ in range(rounds):
                for count, each in ((1, map), (cores, every.map)):
                    start = time.perf_counter()
                    list(each(predictor.predict, files))
                    best[count] = min(best[count], time.perf_counter() - start)
        one, many = len(files) / best[1], len(files) / best[cores]
        print(
            f"{detector}: {one:.1f} pictures a second in one thread, {many:.1f} in {cores}: {many / one:.2f}x"
        )


def resident(detector: str, folder: Path, total: int) -> tuple[float, float, float]:
    """MiB in the first and the last quarter of so many pictures, and how many a second; in a process of its
    own, which has read one before."""
    predictor, process = Predictor(detector=detector), psutil.Process()
    files = cycle(sorted(folder.iterdir()))
    predictor.predict(next(files))
    sizes, start = [], time.perf_counter()
    for file in islice(files, total):
        predictor.predict(file)
        sizes.append(process.memory_info().rss / (1 << 20))
    quarters = np.array_split(sizes, 4)
    return float(quarters[0].mean()), float(quarters[-1].mean()), total / (time.perf_counter() - start)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a sixth of everything")
    parser.add_argument("--pictures", type=int, help="how many the memory is looked at over: 2000, or 300")
    parser.add_argument("--detector", action="append", help="instead of mediapipe and litert")
    options = parser.parse_args()
    detectors: list[str] = options.detector or list(DETECTORS)
    rounds, total = (2, 300) if options.quick else (3, 2000)
    MediaPipe().mesh(np.zeros((64, 64, 3), np.uint8), 1)  # one line where it is not installed
    with tempfile.TemporaryDirectory() as name:
        places = write_inputs(Path(name), 20 if options.quick else 60)
        print(f"{os.cpu_count()} cores\n\n{HEADER}")
        for text, place in places.items():
            compare(text, place, detectors, rounds)
        print()
        folder = next(iter(places.values()))
        with_threads(folder, detectors, rounds)
        flat = True
        for detector in detectors:
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                first, last, rate = pool.apply(resident, (detector, folder, options.pictures or total))
            flat &= last <= GROWTH * first
            memory = f"{first:.0f} MiB in the first quarter, {last:.0f} in the last, {last / first - 1:+.1%}"
            print(
                f"{detector}: {options.pictures or total} pictures, {rate:.1f} a second; {memory}", flush=True
            )
    print(f"memory flat: {'yes' if flat else 'NO'}")
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
