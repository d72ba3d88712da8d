# SPDX-License-Identifier: GPL-3.0-or-later
"""Packages that were installed later may bring numpy or pyarrow that do not go with the rest: one line."""

from __future__ import annotations

import subprocess
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from generator.errors import UsageError
from generator.execution.lanes import renderer

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("wanted", "found", "refused"),
    [
        ("numpy<2.0,>=1.26", "2.4.6", True),
        ("numpy<2.0,>=1.26", "1.26.4", False),
        ("numpy>=2.0", "2.4.6", False),
        (None, "2.4.6", False),
    ],
)
def test_numpy_that_bpy_excludes_is_told_before_a_worker_starts(
    wanted: str | None, found: str, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(renderer, "find_spec", lambda name: ModuleSpec(name, None))
    monkeypatch.setattr(
        renderer, "requires", lambda name: ["cython", "numpydoc<9", wanted] if wanted else None
    )
    monkeypatch.setattr(renderer, "version", {"numpy": found, "bpy": "4.5.15"}.__getitem__)
    if not refused:
        assert renderer.worker_command(None, 1)
        return
    with pytest.raises(UsageError, match=r"bpy 4\.5\.15 needs numpy<2.*numpy 2\.4\.6 is installed: pip"):
        renderer.worker_command(None, 1)


@pytest.mark.parametrize("module", ["generator.cli", pytest.param("downstream_hpe.cli", id="downstream-hpe")])
def test_a_pyarrow_for_another_numpy_ends_in_one_line(module: str, tmp_path: Path) -> None:
    (tmp_path / "pyarrow").mkdir()
    (tmp_path / "pyarrow" / "__init__.py").write_text(
        'raise ImportError("pyarrow requires NumPy 2.0 or newer, found 1.26.4")\n'
    )
    (tmp_path / "dataset").mkdir()
    program = (
        f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]; "
        f"sys.argv = ['it', 'evaluate', 'headturn', {str(tmp_path / 'dataset')!r}]; "
        f"from {module} import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1
    assert "found 1.26.4: pip install 'pyarrow<22'" in done.stderr and done.stderr.count("\n") == 1
