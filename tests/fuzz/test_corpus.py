# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer's corpus and what it found, through every reader once more, without the fuzzer."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import tomllib
from choices import Choices, edited
from targets import CORPUS, TARGETS, Target, promised

ROOT = Path(__file__).resolve().parents[2]
MAX_CORPUS_BYTES = 200_000
SLOWEST_S = 10.0


def inputs() -> list:
    """Every input in the repository, and a few choices of each kind."""
    slow = [pytest.mark.slow]
    return [
        pytest.param(target, marks=slow if target.slow else [], id=name) for name, target in TARGETS.items()
    ]


@pytest.mark.parametrize("target", inputs())
@pytest.mark.filterwarnings("default")
def test_a_reader_says_what_it_promises_of_every_input(target: Target) -> None:
    files = sorted(target.corpus.iterdir())
    every = [(file.name, file.read_bytes()) for file in files]
    every += [
        (f"choices {k}", bytes([255, k % 256, k // 7, 3 * k % 256, k % 5, k % 11, 9])) for k in range(60)
    ]
    every += [("nothing", b""), ("a byte", b"\xff"), ("cut", every[0][1][: len(every[0][1]) // 2])]
    with contextlib.suppress(Exception):
        target.run(every[0][1])  # for what it imports
    for name, data in every:
        began = time.monotonic()
        try:
            target.run(data)
        except promised() as error:
            assert str(error) and "\n" not in str(error), name
        except Exception as error:
            error.add_note(f"{target.name}: {name}")
            raise
        assert time.monotonic() - began < SLOWEST_S, name


@pytest.mark.slow
def test_no_input_takes_a_gigabyte() -> None:
    """As the fuzzer has it: whoever asks for more gets a MemoryError."""
    code = (
        "import contextlib, warnings\n"
        "import targets\n"
        "warnings.simplefilter('ignore')\n"
        "chosen = [one for one in targets.TARGETS.values() if not one.slow]\n"
        "for one in chosen: one.run((one.corpus / 'sound-0').read_bytes())\n"
        "targets.limit_memory()\n"
        "for one in chosen:\n"
        "    for file in sorted(one.corpus.iterdir()):\n"
        "        with contextlib.suppress(*targets.promised()): one.run(file.read_bytes())\n"
    )
    paths = {"PYTHONPATH": os.pathsep.join([str(CORPUS.parent), str(ROOT)]), "MALLOC_ARENA_MAX": "2"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **paths}
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("target", inputs())
def test_the_sound_files_are_read(target: Target) -> None:
    for file in sorted(target.corpus.glob("sound-*")):
        target.run(file.read_bytes())


def test_the_corpus_is_small_and_every_folder_has_its_target() -> None:
    files = [file for file in CORPUS.rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) < MAX_CORPUS_BYTES
    assert {file.parent.name for file in files} == set(TARGETS)
    assert {file.name.partition("-")[0] for file in files} <= {"sound", "more", "found"}


def test_choices_edit_a_document_and_leave_the_first_as_it_is() -> None:
    document = {"a": [1, 2, {"b": "c"}], "d": None}
    before = json.dumps(document)
    found = {
        json.dumps(edited(document, Choices(bytes([k, 3 * k, 7 * k % 256, k, k // 2, k // 3]))))
        for k in range(80)
    }
    assert len(found) > 15 and json.dumps(document) == before
    assert Choices(b"").below(7) == 0 and not Choices(b"").left


def test_make_fuzz_runs_every_target() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["optional-dependencies"]["fuzz"][0].startswith("atheris==")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "tests/fuzz/run.py --seconds $(FUZZ_SECONDS)" in makefile
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("run.py")), "--help"], capture_output=True, text=True
    )
    assert done.returncode == 0 and all(name in done.stdout for name in TARGETS)
