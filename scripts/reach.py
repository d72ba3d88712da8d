# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tests reach which statement, and forks that run some of them: of mutants.py."""

from __future__ import annotations

import importlib
import os
import resource
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIMIT_S, TIMES = 30, 5
"""Tests of a mutant that take so many seconds of a processor, and times all tests alone, never end; nor do
those that sleep ten times as long."""

SHARED = (
    "coverage",
    "typer",
    "numpy",
    "pyarrow.dataset",
    "scipy.optimize",
    "scipy.spatial.transform",
    "PIL.Image",
)
"""Libraries that most tests need, and that take longer to import than a test to notice."""

OPTIONS = (
    *("-x", "-q", "-p", "no:cacheprovider", "-m", "not slow", "-o", "tmp_path_retention_policy=none"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),  # of what load_libraries imported
)


def load_libraries() -> None:
    """What the forks share, and nothing of ours: that is imported in each."""
    for name in SHARED:
        importlib.import_module(name)


def name_of(file: str) -> str:
    """What a module is called."""
    return file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def in_a_fork(
    tests: Sequence[str], prepare: Callable[[], Sequence[object]] = list, limit_s: int = 3600
) -> int:
    """Process id of a run of tests that ends at the first that fails.

    prepare: what is done there before; it returns plugins of pytest. limit_s: of a processor.
    """
    pid = os.fork()
    if pid:
        return pid
    code = 99
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        code = int(pytest.main([*OPTIONS, *tests], prepare()))
    finally:
        os._exit(code)
    raise AssertionError


class Lines:
    """A plugin of pytest that writes down which test reaches which line.

    What modules do on import is under "", and what a shared fixture does under the name of what shares it:
    all of that may see it.
    """

    def __init__(self, files: Sequence[Path], data: Path) -> None:
        import coverage

        self._cov = coverage.Coverage(str(data), include=[str(file) for file in files], config_file=False)
        self._cov.start()
        for file in files:  # now: the first test that needs one would have it all for itself
            importlib.import_module(name_of(file.relative_to(ROOT).as_posix()))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Under the name of the test."""
        self._test = item.nodeid
        self._cov.switch_context(item.nodeid)
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, request: pytest.FixtureRequest) -> Iterator[None]:
        """Under the name of whatever shares the fixture: "" is everything."""
        self._cov.switch_context(request.node.nodeid)
        try:
            return (yield)
        finally:
            self._cov.switch_context(self._test)

    def pytest_unconfigure(self) -> None:
        """At the end."""
        self._cov.stop()
        self._cov.save()


@dataclass(frozen=True)
class Tests:
    """Tests of a part, and which of them reach its lines: names of tests and modules by file and line.

    limit_s: of a processor; what takes longer never ends.
    """

    every: Sequence[str]
    by_line: Mapping[str, Mapping[int, Sequence[str]]]
    limit_s: int

    @classmethod
    def that_reach(cls, files: Sequence[Path], every: Sequence[str]) -> Tests:
        """Run them once to see. SystemExit: they fail as they are."""
        import coverage

        with tempfile.TemporaryDirectory() as folder:
            data = coverage.CoverageData(f"{folder}/reach")
            took_s = _run_or_exit(every, lambda: [Lines(files, Path(folder, "reach"))])
            data.read()
            by_line = {file: data.contexts_by_lineno(file) for file in data.measured_files()}
        # A test that cannot be called by its name would look like one that notices.
        names = {name for lines in by_line.values() for found in lines.values() for name in found if name}
        _run_or_exit(["--collect-only", *sorted(names)])
        return cls(every, by_line, max(LIMIT_S, TIMES * int(took_s)))

    def of(self, file: str, lines: range) -> list[str]:
        """Those that reach a statement: all, where it is run on import."""
        by_line = self.by_line.get(str(ROOT / file), {})
        names = dict.fromkeys(name for line in lines for name in by_line.get(line, ()))
        if "" in names:
            return [*self.every]
        return [name for name in names if "::" not in name or name.split("::")[0] not in names]


def _run_or_exit(tests: Sequence[str], prepare: Callable[[], Sequence[object]] = list) -> float:
    """Seconds of a processor that it took."""
    _, status, used = os.wait4(in_a_fork(tests, prepare), 0)
    if os.waitstatus_to_exitcode(status):
        sys.exit(f"mutants.py: {' '.join(tests)} fail as they are; mend them first")
    return used.ru_utime
