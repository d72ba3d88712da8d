# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory a command takes, told by the system."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def peak_mb(*words: str | Path, seconds: float = 60) -> tuple[int, float, str]:
    """Exit code, MB at the most, and all that was said, of ``python -m`` these words."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    command = [sys.executable, "-c", _MEASURED, str(seconds), *map(str, words)]
    done = subprocess.run(
        command, env=environment, text=True, capture_output=True, timeout=seconds + 30, check=False
    )
    said, _, peak = done.stderr.rpartition("\npeak ")
    return done.returncode, int(peak) / 1024, done.stdout + said


_MEASURED = """
import resource, subprocess, sys
done = subprocess.run([sys.executable, "-m", *sys.argv[2:]], timeout=float(sys.argv[1]))
print(f"\\npeak {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss}", file=sys.stderr)
sys.exit(done.returncode)
"""
