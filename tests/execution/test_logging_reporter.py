# SPDX-License-Identifier: GPL-3.0-or-later
"""The log that a build leaves in its folder."""

from __future__ import annotations

import json
import re
import threading
import time
from pathlib import Path
from typing import TextIO

import pytest
from quiet import Quiet

from generator.execution.status import LOG_FILE, LoggingReporter

TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ "


def lines(root: Path) -> list[str]:
    """What the log says, without its times."""
    found = (root / LOG_FILE).read_text(encoding="utf-8").splitlines()
    assert all(re.match(TIME, line) for line in found)
    return [re.sub(TIME, "", line, count=1) for line in found]


def test_everything_but_the_steps_is_written_and_passed_on(tmp_path: Path) -> None:
    said, steps = Quiet(), []
    said.on_frame = lambda: steps.append(None)
    with LoggingReporter(said, tmp_path) as logged:
        logged.log("headturn 9")
        logged.stage("rendering", 12)
        logged.advance()
        logged.note("Zoë was skipped")
        logged.event("unit", {"attempts": 2, "seconds": {"load": 0.5}})
        # Who looks into a running build sees what there is.
        assert len(lines(tmp_path)) == 4
    assert lines(tmp_path) == [
        "headturn 9",
        "rendering: 12",
        "Zoë was skipped",
        "unit " + json.dumps({"attempts": 2, "seconds": {"load": 0.5}}),
    ]
    assert (said.stages, said.notes, len(steps)) == ({"rendering": 12}, ["Zoë was skipped"], 1)
    assert said.events == [("unit", {"attempts": 2, "seconds": {"load": 0.5}})]


def test_another_build_goes_on_below_and_an_end_has_its_reason(tmp_path: Path) -> None:
    with LoggingReporter(Quiet(), tmp_path) as logged:
        logged.note("first")
    with pytest.raises(KeyError), LoggingReporter(Quiet(), tmp_path) as logged:
        raise KeyError("what")
    assert lines(tmp_path) == ["first", "stopped: KeyError: 'what'"]


class Slow:
    """A file that lets other threads in between the halves of a line."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, text: str) -> None:
        """See TextIO."""
        self._file.write(text[:50])
        time.sleep(1e-3)
        self._file.write(text[50:])

    def close(self) -> None:
        """See TextIO."""
        self._file.close()


def test_lines_of_several_threads_do_not_mix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with LoggingReporter(Quiet(), tmp_path) as logged:
        assert logged._file is not None
        monkeypatch.setattr(logged, "_file", Slow(logged._file))
        threads = [
            threading.Thread(target=lambda k=k: [logged.log(f"{k}" * 200) for _ in range(10)])
            for k in range(4)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(20)
    found = lines(tmp_path)
    assert len(found) == 40
    assert all(len(line) == 200 and len(set(line)) == 1 for line in found)


def test_a_full_disk_is_told_by_whoever_writes_what_matters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = Quiet()
    with LoggingReporter(said, tmp_path) as logged:

        class Full:
            def write(self, text: str) -> None:
                raise OSError(28, "No space left on device")

            def close(self) -> None:
                raise OSError(28, "No space left on device")

        opened = logged._file
        assert opened is not None
        monkeypatch.setattr(logged, "_file", Full())
        logged.note("still told")
        opened.close()
    assert said.notes == ["still told"]
