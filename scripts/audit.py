#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares what make installs with known advisories: our own list, and a live one where that answers.

    python scripts/audit.py [--pip-audit COMMAND]

Ends with 1 if an advisory applies to a lock and nobody said in requirements/advisories.toml why that version
is held back. Says how many packages the live list knew; offline that is none, and then only our list counts.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import tomllib
from lock import FOLDER, Pins, lock_file, normalised, read_lock
from pip._vendor.packaging.specifiers import SpecifierSet  # there wherever make lock is

LOCKS = ("dev", "build", "fuzz", "audit")
ADVISORIES = FOLDER / "advisories.toml"
TIMEOUT_S = 300


class Offline(Exception):
    """The live list answered nothing."""


@dataclass(frozen=True)
class Advisory:
    """An entry of advisories.toml."""

    id: str
    package: str
    affected: str
    what: str
    here: str
    held_back: str = ""

    def applies(self, pins: Pins) -> bool:
        """Does a lock hold an affected version?"""
        found = pins.get(normalised(self.package))
        return found is not None and SpecifierSet(self.affected).contains(found[0], prereleases=True)


def main() -> int:
    """Say what is known; 1 if something must be done."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--pip-audit", help="the program; without it only our own list is looked at")
    arguments = parser.parse_args()
    pins = {name: read_lock(lock_file(name)) for name in LOCKS}
    known, as_of = advisories()
    problems = list(ours(known, as_of, pins))
    try:
        if arguments.pip_audit is None:
            raise Offline
        problems += live(arguments.pip_audit, pins, known)
    except Offline:
        print(f"live list: not reached (offline), so only our list of {as_of} was looked at")
    for problem in problems:
        print(f"FAIL  {problem}")
    return 1 if problems else 0


def advisories() -> tuple[list[Advisory], str]:
    """Our list, and of when it is."""
    values = tomllib.loads(ADVISORIES.read_text(encoding="utf-8"))
    return [Advisory(**entry) for entry in values["advisory"]], values["as_of"]


def ours(known: list[Advisory], as_of: str, pins: dict[str, Pins]) -> Iterator[str]:
    """What of our list applies and is not held back; what is, is printed."""
    print(f"our list: {len(known)} advisories, as of {as_of}")
    for advisory in known:
        where = [name for name, lock in pins.items() if advisory.applies(lock)]
        if not where:
            continue
        version = pins[where[0]][normalised(advisory.package)][0]
        line = f"{advisory.id}: {advisory.package} {version} ({', '.join(where)}): {advisory.what}"
        if not advisory.held_back:
            yield f"{line}; renew the lock (make lock), or say why not in {ADVISORIES.name}"
            continue
        print(f"held  {line}\n      here: {advisory.here}\n      why:  {advisory.held_back}")


def live(command: str, pins: dict[str, Pins], known: list[Advisory]) -> list[str]:
    """What pip-audit says beyond our list. Raises Offline if it is not there or knew no package at all."""
    found: list[str] = []
    answered = asked = 0
    listed = {advisory.id for advisory in known}
    for name in LOCKS:
        options = ["--requirement", str(lock_file(name)), "--no-deps", "--disable-pip", "--format", "json"]
        try:
            done = subprocess.run(
                [command, *options, "--progress-spinner", "off"],
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
                check=False,
            )
            rows = json.loads(done.stdout)["dependencies"]
        except (OSError, ValueError, KeyError, subprocess.TimeoutExpired) as error:
            raise Offline from error
        # pip-audit ends with 0 and "no known vulnerabilities" also where it could ask nobody.
        asked, answered = asked + len(rows), answered + sum("skip_reason" not in row for row in rows)
        for row in rows:
            for one in row.get("vulns", ()):
                names = {one["id"], *one.get("aliases", ())}
                if not names & listed:
                    fixed = ", ".join(one.get("fix_versions", ())) or "no version"
                    found.append(f"{one['id']}: {row['name']} {row['version']} ({name}), fixed in {fixed}")
    if not answered:
        raise Offline
    print(f"live list: knew {answered} of {asked} packages, {len(found)} advisories that ours lacks")
    return found


if __name__ == "__main__":
    sys.exit(main())
