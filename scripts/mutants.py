#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes the code in one place at a time and asks whether a test notices (make mutants).

    python scripts/mutants.py [PART ...] [--each 40] [--seed 1] [--jobs 2]

The parts and their tests are in tests/mutants/parts.toml; the changes are cosmic-ray's: a number is one off,
a comparison another one, a sum a difference, a loop is not entered, a decorator gone. --each: so many of each
part, drawn by the seed; 0 for all. What survives and is not in tests/mutants/survivors.toml, with the reason
why no test can or needs to notice, is printed; exit code 1 where less than 85 % of what was tried is noticed.

No file is changed: each mutant lives in a fork of this process that imports the module from changed text, and
runs the tests that reach the changed statement.
"""

from __future__ import annotations

import argparse
import ast
import fnmatch
import importlib.abc
import importlib.machinery
import importlib.util
import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import tomllib
from reach import ROOT, Tests, in_a_fork, load_libraries, name_of

FOLDER = ROOT / "tests" / "mutants"
ENOUGH = 0.85
LEFT_OUT = ("core/NoOp", "core/Variable*", "core/ReplaceBinaryOperator_*", "core/ReplaceComparisonOperator_*")
"""Operators; of the two large families those below are in. Most of the others, such as a shift in place of a
sum of floats, cannot run at all, and would only make the share look better."""
TAKEN = tuple(
    f"core/Replace{family}Operator_{pair}"
    for family, pairs in {
        "Binary": "Add_Sub Sub_Add Mul_Div Div_Mul FloorDiv_Mul Mod_Mul Pow_Mul BitAnd_BitOr BitOr_BitAnd",
        "Comparison": "Lt_LtE LtE_Lt Gt_GtE GtE_Gt Lt_GtE GtE_Lt Gt_LtE LtE_Gt "
        "Eq_NotEq NotEq_Eq Is_IsNot IsNot_Is",
    }.items()
    for pair in pairs.split()
)
GUARDS = ("strict", "frozen")
"""Arguments of zip and dataclass for those who write code, as assert is: nothing here runs into them."""


@dataclass(frozen=True)
class Mutant:
    """A module's text with one change. line: of the module, from 1; was, becomes: the line.

    statement: lines of the innermost statement that is changed.
    """

    file: str
    line: int
    was: str
    becomes: str
    text: str
    statement: range

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is known by in survivors.toml, wherever its line is by then."""
        return self.file, self.was, self.becomes

    def imported(self) -> list[object]:
        """From now on, this process imports the changed text."""
        sys.meta_path.insert(0, Changed(self.file, self.text))
        return []


Place = tuple[Path, str, int]
"""A module, an operator's name, and which of the places in the module that it can change."""


def places_in(file: Path) -> Iterator[Place]:
    """Everywhere that a module can be changed."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    nodes = list(ast_nodes(get_ast(file.read_text(encoding="utf-8"))))
    for name in operator_names():
        if name in TAKEN or not any(fnmatch.fnmatch(name, pattern) for pattern in LEFT_OUT):
            operator = get_operator(name)()
            count = sum(len(list(operator.mutation_positions(node))) for node in nodes)
            yield from ((file, name, occurrence) for occurrence in range(count))


def mutant_at(place: Place) -> Mutant | None:
    """The change; None where it changes nothing that is run, or is no Python."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    file, name, occurrence = place
    source = file.read_text(encoding="utf-8")
    try:
        text = mutate_code(source, get_operator(name)(), occurrence)
        if text is None or _meaning(text) == _meaning(source):
            return None
    except (SyntaxError, AttributeError):  # the latter is cosmic-ray's, of `except csv.Error`
        return None
    before, after = source.splitlines(), text.splitlines()
    at = next(k for k, pair in enumerate(zip(before, [*after, ""], strict=False)) if pair[0] != pair[1])
    while not before[at].strip():  # they go with a decorator
        at += 1
    becomes = "(gone)" if len(after) < len(before) else after[at].strip()
    statements = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.stmt))
    spans = (range(one.lineno, (one.end_lineno or one.lineno) + 1) for one in statements)
    statement = min((span for span in spans if at + 1 in span), key=len, default=range(at + 1, at + 2))
    return Mutant(file.relative_to(ROOT).as_posix(), at + 1, before[at].strip(), becomes, text, statement)


def _meaning(source: str) -> str:
    """What of a module is run: neither annotations, as long as nobody asks for them, nor guards.

    To numpy any negative side of a shape is the one to be found.
    """
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            node.annotation = None
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            node.returns = None
        elif isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
        elif isinstance(node, ast.Call):
            node.keywords = [one for one in node.keywords if one.arg not in GUARDS]
            if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
                node.args = [ast.Constant(-1) if isinstance(a, ast.UnaryOp) else a for a in node.args]
    return ast.dump(tree)


class Changed(importlib.abc.MetaPathFinder, importlib.abc.SourceLoader):
    """Imports one module from other text than its file has."""

    def __init__(self, file: str, text: str) -> None:
        self._name = name_of(file)
        self._path, self._text = str(ROOT / file), text

    def find_spec(self, name: str, path: object = None, target: object = None) -> Any:
        """The spec of the module, and of no other."""
        if name != self._name:
            return None
        places = [str(Path(self._path).parent)] if self._path.endswith("__init__.py") else None
        return importlib.util.spec_from_file_location(
            name, self._path, loader=self, submodule_search_locations=places
        )

    def get_filename(self, name: str) -> str:
        """Where the module has its data."""
        return self._path

    def get_data(self, path: str | bytes) -> bytes:
        """The changed text."""
        return self._text.encode()


def wait_for(running: dict[int, tuple[Mutant, float]], limit_s: float) -> tuple[Mutant, bool]:
    """The next of the running mutants that is at its end, and whether it was noticed."""
    while True:
        for pid, (mutant, began) in list(running.items()):
            ended, status = os.waitpid(pid, os.WNOHANG)
            late = time.monotonic() - began > limit_s
            if not ended and not late:
                continue
            if not ended:
                os.killpg(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
            del running[pid]
            return mutant, late or os.waitstatus_to_exitcode(status) != 0
        time.sleep(0.02)


def survivors_of(mutants: Sequence[Mutant], tests: Tests, jobs: int) -> list[Mutant]:
    """Those that no test notices, in their order."""
    todo, running = [mutant for mutant in mutants if tests.of(mutant.file, mutant.statement)], {}
    left = [mutant for mutant in mutants if mutant not in todo]
    while todo or running:
        while todo and len(running) < jobs:
            mutant = todo.pop()
            some = tests.of(mutant.file, mutant.statement)
            running[in_a_fork(some, mutant.imported, tests.limit_s)] = mutant, time.monotonic()
        mutant, noticed = wait_for(running, 10 * tests.limit_s)
        left += [] if noticed else [mutant]
    return sorted(left, key=lambda one: (one.file, one.line))


def excused() -> dict[tuple[str, str, str], str]:
    """Reasons of survivors that are known."""
    known = tomllib.loads((FOLDER / "survivors.toml").read_text(encoding="utf-8"))
    return {(one["file"], one["was"], one["becomes"]): one["why"] for one in known["survivor"]}


def main() -> int:
    """Try the parts that were asked for."""
    parts = tomllib.loads((FOLDER / "parts.toml").read_text(encoding="utf-8"))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*parts, []], help="all if absent")
    parser.add_argument("--each", type=int, default=40, help="mutants of each part; 0 for all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    asked = parser.parse_args()
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    load_libraries()
    known, tried, noticed, new = excused(), 0, 0, 0
    for name in asked.parts or parts:
        files = sorted({file for pattern in parts[name]["sources"] for file in ROOT.glob(pattern)})
        places = [place for file in files for place in places_in(file)]
        random.Random(asked.seed).shuffle(places)
        some = list(islice(filter(None, map(mutant_at, places)), asked.each or None))
        left = survivors_of(some, Tests.that_reach(files, parts[name]["tests"]), asked.jobs)
        killed = len(some) - len(left)
        print(f"{name}: {killed} of {len(some)} noticed; {len(places)} places could be changed", flush=True)
        for one in left:
            reason = known.get(one.key)
            new += reason is None
            print(f"  {one.file}:{one.line}: {one.was}\n    -> {one.becomes}")
            print(f"    {reason or 'NOT EXPLAINED'}", flush=True)
        tried, noticed = tried + len(some), noticed + killed
    share = noticed / max(tried, 1)
    print(f"{noticed} of {tried} noticed, {share:.1%} (seed {asked.seed}); {new} survive without a reason")
    return 0 if share >= ENOUGH and not new else 1


if __name__ == "__main__":
    sys.exit(main())
