# SPDX-License-Identifier: GPL-3.0-or-later
"""The host's side of a render worker."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path

from generator.errors import HeadError, UsageError, WorkerError
from generator.execution.lanes.lines import LineProcess
from generator.execution.lanes.scratch import scratch_folder
from generator.plan.render_settings import RenderSettings

_PACKAGE = Path(__file__).resolve().parents[2]

OLDEST_BLENDER = (4, 2)

DEADLINE_S = 300.0
"""Longest wait for one sign of life. Loading a large scan and its first frame take seconds."""


def worker_command(blender: str | None, threads: int) -> list[str]:
    """How a render worker is started: inside a Blender executable, or with the bpy wheel.

    Raises UsageError if the executable does not exist, or bpy is not installed.
    """
    if blender is not None:
        if not os.access(blender, os.X_OK):
            raise UsageError(
                f"{blender}: not an executable Blender; give the path of one, or leave --blender out"
            )
        script = str(_PACKAGE / "blender" / "worker.py")
        flags = ["--background", "--factory-startup", "--python-exit-code", "1", "--python", script]
        return [blender, *flags, "--", str(threads)]
    if find_spec("bpy") is None:
        raise UsageError(
            "bpy is not installed: pip install 'headturn[build]' with Python 3.11, "
            "or name a Blender with --blender"
        )
    return [sys.executable, "-m", "generator.blender.worker", str(threads)]


def check_blender(blender: str) -> None:
    """Ask a Blender executable for its version. UsageError if it is none, or older than 4.2."""
    try:
        said = subprocess.run(
            [blender, "--version"], capture_output=True, text=True, timeout=DEADLINE_S, check=False
        ).stdout
    except (OSError, subprocess.TimeoutExpired) as error:
        raise UsageError(f"{blender}: cannot be started ({error}); give the path of a Blender") from error
    found = re.search(r"^Blender (\d+)\.(\d+)", said, re.MULTILINE)
    if found is None:
        raise UsageError(f"{blender}: does not answer --version as a Blender does; give the path of one")
    if (int(found[1]), int(found[2])) < OLDEST_BLENDER:
        oldest = ".".join(map(str, OLDEST_BLENDER))
        raise UsageError(f"{blender}: {found[0]} is too old, Headturn needs {oldest} or newer")


class Renderer:
    """One render worker and the folder its frames appear in.

    Parameters
    ----------
    frames: an existing folder, best on a tmpfs.
    blender: a Blender executable; None uses the bpy wheel.
    threads: Cycles threads; 0 means every core.
    deadline_s: a worker that is silent for so long hangs, and is ended.
    """

    def __init__(
        self,
        frames: Path,
        log: Path,
        *,
        blender: str | None = None,
        threads: int = 0,
        deadline_s: float = DEADLINE_S,
    ) -> None:
        self.frames = frames
        self._deadline_s = deadline_s
        path = os.pathsep.join([str(_PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
        # A Blender executable must not see our environment: its Python is another one.
        env = {"PYTHONPATH": path} if blender is None else {"PYTHONPATH": ""}
        # Nor another colour management, which studios set for all programs and Blender 5 for its children.
        env["OCIO"] = ""
        # Blender's own temporary folder goes with ours, also when the worker is killed.
        env |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(frames))
        self._process = LineProcess(worker_command(blender, threads), log, env)
        ready = self._process.receive(deadline_s)
        if "ready" not in ready:
            raise WorkerError(f"the render worker did not start: {ready}")
        self.version: str = ready["ready"]

    @property
    def pid(self) -> int:
        """Process id of the render worker."""
        return self._process.pid

    def render(
        self,
        package: Path,
        settings: RenderSettings,
        distance_mm: float,
        poses: Sequence[Sequence[float]],
        *,
        frame_format: str = "bmp",
        passes: Sequence[str] = (),
    ) -> Iterator[Path]:
        """Render poses [(yaw, pitch, roll) degrees, ...] of a prepared head.

        passes: render these instead of the picture, see generator.blender.passes.

        Yields each frame's path as soon as it is written; the caller removes it.
        Raises HeadError if Blender cannot load the head, WorkerError if the
        worker dies.
        """
        self._process.send(
            {
                "op": "render",
                "package": str(package),
                "settings": settings.as_dict(),
                "distance_mm": distance_mm,
                "poses": [list(map(float, pose)) for pose in poses],
                "out": str(self.frames),
                "format": "exr" if passes else frame_format,
                "passes": list(passes),
            }
        )
        for receipt in self._receipts():
            if "path" in receipt:
                yield Path(receipt["path"])

    def import_mesh(self, source: Path, folder: Path) -> Path:
        """Have Blender read an FBX file and write it into folder as GLB, whose path is returned."""
        target = folder / f"{source.stem}.glb"
        self._process.send({"op": "convert", "source": str(source), "target": str(target)})
        for _ in self._receipts():
            pass
        return target

    def close(self) -> None:
        """End the worker."""
        self._process.close()

    def kill(self) -> None:
        """End the worker now."""
        self._process.kill()

    def _receipts(self) -> Iterator[dict]:
        while True:
            receipt = self._process.receive(self._deadline_s)
            if "error" in receipt:
                raise HeadError(f"Blender: {receipt['error']}")
            yield receipt
            if "done" in receipt:
                return


@contextmanager
def mesh_importer(blender: str | None = None) -> Iterator[Callable[[Path, Path], Path]]:
    """:meth:`Renderer.import_mesh` of a worker that starts only if a mesh needs it."""
    with ExitStack() as stack:
        worker: Renderer | None = None

        def import_mesh(source: Path, folder: Path) -> Path:
            nonlocal worker
            if worker is None:
                scratch = stack.enter_context(scratch_folder())
                worker = Renderer(scratch, scratch / "render.log", blender=blender)
                stack.callback(worker.close)
            return worker.import_mesh(source, folder)

        yield import_mesh
