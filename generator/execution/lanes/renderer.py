# SPDX-License-Identifier: GPL-3.0-or-later
"""The host's side of a render worker."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from generator.errors import HeadError, UsageError, WorkerError
from generator.execution.lanes.lines import LineProcess
from generator.execution.lanes.options import DEADLINE_S
from generator.execution.lanes.scratch import scratch_folder
from generator.interpreter import python_command
from generator.messages import (
    ConvertOrder,
    OrderDone,
    OrderFailed,
    Rendered,
    RenderOrder,
    SceneOrder,
    WorkerReady,
    expect,
    to_json,
)
from generator.plan.environment_light import EnvironmentLight
from generator.plan.views import Views
from generator.plan.wear import Worn
from litert_faces.installing import install_command

_PACKAGE = Path(__file__).resolve().parents[2]

OLDEST_BLENDER = (4, 2)


def worker_command(blender: str | None, threads: int, gpu: int | None = None) -> list[str]:
    """How a render worker is started: inside a Blender executable, or with the bpy wheel.

    gpu: see :class:`generator.blender.devices.Device`.
    Raises UsageError if the executable does not exist, or bpy is not installed.
    """
    words = [str(threads)] if gpu is None else [str(threads), str(gpu)]
    if blender is not None:
        if not os.access(blender, os.X_OK):
            raise UsageError(
                f"{blender}: not an executable Blender; give the path of one, or leave --blender out"
            )
        script = str(_PACKAGE / "blender" / "worker.py")
        flags = ["--background", "--factory-startup", "--threads", str(threads)]
        return [blender, *flags, "--python-exit-code", "1", "--python", script, "--", *words]
    if find_spec("bpy") is None:
        raise UsageError(
            f"bpy is not installed: {install_command('build')} with Python 3.11, "
            "or name a Blender with --blender"
        )
    _check_numpy()
    return python_command("generator.blender.worker", *words)


def _check_numpy() -> None:
    """UsageError if numpy is one that the bpy wheel excludes: whatever was installed later, such as pandas,
    may have replaced it, and pip only warns."""
    try:
        wanted = next((one for one in requires("bpy") or () if re.match(r"numpy\b", one)), "")
    except PackageNotFoundError:
        return  # a bpy that pip did not bring
    below = re.search(r"<\s*(\d+)", wanted)
    found = version("numpy")
    if below and int(found.partition(".")[0]) >= int(below[1]):
        raise UsageError(
            f"bpy {version('bpy')} needs {wanted}, and numpy {found} is installed: {install_command('build')}"
        )


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
    """One render worker and the folder its images appear in.

    Parameters
    ----------
    images: an existing folder, best on a tmpfs.
    blender: a Blender executable; None uses the bpy wheel.
    threads: Cycles threads; 0 means every core.
    gpu: the number of its lane, to render on a GPU; None renders on the CPU.
    deadline_s: a worker that is silent for so long hangs, and is ended.

    version: of its Blender, and the GPU that it renders on. device: that GPU; empty for the CPU.
    """

    def __init__(
        self,
        images: Path,
        log: Path,
        *,
        blender: str | None = None,
        threads: int = 0,
        gpu: int | None = None,
        deadline_s: float = DEADLINE_S,
    ) -> None:
        self.images = images
        self._deadline_s = deadline_s
        # Not another colour management, which studios set for all programs and Blender 5 for its children.
        env = {"OCIO": ""}
        if blender is not None:
            env["PYTHONPATH"] = ""  # nor our modules: its Python is another one
        # Blender's own temporary folder goes with ours, also when the worker is killed.
        env |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(images))
        self._process = LineProcess(worker_command(blender, threads, gpu), log, env)
        ready = expect(WorkerReady, self._receive())
        self.device = ready.device
        # Every processor rounds a little differently, as every Blender does.
        self.version = f"{ready.version} on {ready.device}" if ready.device else ready.version

    @property
    def pid(self) -> int:
        """Process id of the render worker."""
        return self._process.pid

    def render(
        self,
        package: Path,
        views: Views,
        *,
        kind: Literal["bmp", "exr"] = "bmp",
        passes: Sequence[str] = (),
        worn: tuple[tuple[Worn, ...], ...] = (),
    ) -> Iterator[Path]:
        """Render views of a packaged head that have no backdrop of their own.

        kind: .bmp (sRGB) or .exr (linear float32).
        passes: render these, as .exr, instead of the picture; see generator.blender.passes.
        worn: see :class:`generator.messages.RenderOrder`.

        Yields the path of each image as soon as it is written; the caller removes it.
        Raises HeadError if Blender cannot load the head, WorkerError if the worker dies.
        """
        kind = "exr" if passes else kind
        order = RenderOrder(str(package), views, str(self.images), kind, tuple(passes), (), worn)
        with closing(self._carried_out(order)) as receipts:
            for receipt in receipts:
                yield Path(receipt.path)

    def shoot(
        self,
        package: Path,
        views: Views,
        lights: tuple[EnvironmentLight | None, ...] = (),
        worn: tuple[tuple[Worn, ...], ...] = (),
    ) -> Iterator[Rendered]:
        """As :meth:`render`, of any views: what is laid over a backdrop comes as its box alone.

        lights: see :class:`generator.messages.RenderOrder`.
        """
        return self._carried_out(RenderOrder(str(package), views, str(self.images), "bmp", (), lights, worn))

    def import_mesh(
        self, source: Path, folder: Path, head_object: str | None = None, shape_key: str = ""
    ) -> Path:
        """Have Blender read a mesh file and write it into folder as GLB, whose path is returned.

        A JSON beside it says which image of a file each of those stands for that stand for one. Of a scene,
        with the object or collection that is its head, it is a package.
        """
        target = folder / f"{source.stem}.glb"
        order: ConvertOrder | SceneOrder = ConvertOrder(str(source), str(target))
        if head_object is not None:
            target = target.with_suffix(".npz")
            order = SceneOrder(str(source), str(target), head_object, shape_key)
        self._send(order)
        for _ in self._receipts():
            pass
        return target

    def close(self) -> None:
        """End the worker."""
        self._process.close()

    def kill(self) -> None:
        """End the worker now."""
        self._process.kill()

    def _send(self, order: RenderOrder | ConvertOrder | SceneOrder) -> None:
        self._process.send(to_json(order))

    def _receive(self) -> object:
        return self._process.receive_message(self._deadline_s)

    def _carried_out(self, order: RenderOrder) -> Generator[Rendered, None, None]:
        """Each image of an order, as soon as it is written."""
        self._send(order)
        receipts = self._receipts()
        try:
            for receipt in receipts:  # noqa: UP028 (yield from would close them)
                yield receipt
        except GeneratorExit:
            # Whoever asks next must not get the rest of these.
            for _ in receipts:
                pass

    def _receipts(self) -> Iterator[Rendered]:
        """What comes until the order is done."""
        while not isinstance(receipt := self._receive(), OrderDone):
            if isinstance(receipt, OrderFailed):
                raise HeadError(f"Blender: {receipt.reason}")
            yield expect(Rendered, receipt)


@contextmanager
def mesh_importer(blender: str | None = None) -> Iterator[Callable[..., Path]]:
    """:meth:`Renderer.import_mesh` of a worker that starts only if a mesh needs it."""
    with ExitStack() as stack:
        worker: Renderer | None = None

        def import_mesh(source: Path, folder: Path, *scene: str) -> Path:
            nonlocal worker
            if worker is None:
                scratch = stack.enter_context(scratch_folder())
                worker = Renderer(scratch, scratch / "render.log", blender=blender)
                stack.callback(worker.close)
            try:
                return worker.import_mesh(source, folder, *scene)
            except WorkerError as error:
                # A file that its importer does not survive is that head's; others get another worker.
                stack.pop_all().close()
                worker = None
                raise HeadError(f"Blender ended while it read the file ({error})") from error

        yield import_mesh
