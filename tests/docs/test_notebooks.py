# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebooks of examples/ run from the first cell to the last, and are kept without what they print."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import nbformat
import pages
import pytest
from nbclient import NotebookClient

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

NOTEBOOKS = sorted((pages.ROOT / "examples").glob("*.ipynb"))
LINE = {"headturn": "generator.cli", "downstream-hpe": "downstream_hpe.cli"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where the notebooks run, one after the other: a dataset that one has built the next one reads.

    The commands are there by name, as where Headturn is installed, and run what is tested.
    """
    folder = tmp_path_factory.mktemp("notebooks")
    for name, module in LINE.items():
        command = folder / "bin" / name
        command.parent.mkdir(exist_ok=True)
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n', encoding="utf-8")
        command.chmod(0o755)
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("PATH", f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}")
        patched.setenv("PYTHONPATH", str(pages.ROOT))
        patched.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
        patched.setenv("IPYTHONDIR", str(folder / "ipython"))
        yield folder


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, folder: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    where = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=800, kernel_name="python3", resources=where).execute()
    printed = "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", ()))
    assert "Error" not in printed and "error:" not in printed, printed


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert not [cell for cell in notebook.cells if cell.get("outputs") or cell.get("execution_count")]
    assert path.stat().st_size < 20_000


def test_every_notebook_is_on_its_page() -> None:
    text = pages.read(pages.ROOT / "docs" / "notebooks.md")
    assert len(NOTEBOOKS) == 4
    assert all(f"examples/{path.name}" in text for path in NOTEBOOKS)
