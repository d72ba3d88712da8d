# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Blender, the extension in it, and the host it starts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from real_blender import ROOT, RealBlender

SETUP = "scripts/real_blender.sh"


@pytest.fixture(scope="session")
def blender_command() -> Path:
    """The executable that scripts/real_blender.sh set up, or HEADTURN_BLENDER."""
    base = Path(os.environ.get("HEADTURN_BLENDER_ROOT", "/opt/headturn-blender"))
    command = Path(os.environ.get("HEADTURN_BLENDER", base / "blender-trixie"))
    if not command.exists():
        message = f"no real Blender at {command}: run {SETUP} (`make blender`) or set HEADTURN_BLENDER"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    return command


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension as it is shipped."""
    out = tmp_path_factory.mktemp("dist")
    script = str(ROOT / "scripts" / "build_extension.py")
    done = subprocess.run(
        [sys.executable, script, "--out", str(out)], check=True, capture_output=True, text=True
    )
    return Path(done.stdout.strip())


@pytest.fixture(scope="session")
def host_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """This Python, as seen from a Blender that may live in a file system of its own."""
    path = tmp_path_factory.mktemp("host") / "python"
    subprocess.run([ROOT / "scripts" / "host_python.sh", sys.executable, path], check=True)
    return path


@pytest.fixture(scope="session")
def real_blender(
    blender_command: Path,
    extension_zip: Path,
    host_python: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> RealBlender:
    """Blender with the extension, in a profile of its own, and this Python as its host."""
    profile = tmp_path_factory.mktemp("profile")
    runner = blender_command.with_name(blender_command.name.replace("blender-", "run-"))
    screen = ("xvfb-run", "-a", "-s", "-screen 0 1280x720x24 +extension GLX")
    windowed = (
        (str(runner), *screen, "blender") if runner != blender_command else (*screen, str(blender_command))
    )
    environment = {"BLENDER_USER_RESOURCES": str(profile), "HEADTURN_PYTHON": str(host_python)}
    blender = RealBlender(str(blender_command), windowed, environment)
    blender.run("--command", "extension", "install-file", "-r", "user_default", "-e", str(extension_zip))
    return blender
