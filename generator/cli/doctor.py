# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn doctor``."""

from __future__ import annotations

import json
from dataclasses import asdict

import typer

from generator import __version__
from generator.cli.checkup import findings
from generator.cli.console import BlenderOption, JsonFlag, say
from generator.content import CONTENT_VERSION
from generator.dataset.format.columns import SCHEMA_VERSION
from litert_faces.checkup import Finding, doomed

STYLES = {"ok": "green", "missing": "yellow", "note": ""}


def doctor(blender: BlenderOption = None, as_json: JsonFlag = False) -> None:
    """Say what is here of what Headturn needs, and the command that brings what is missing.

    Blender and the detectors are started, not only looked for. Paste what it prints into a report of a fault.

    Exit code 1 if no dataset can be built here.
    """
    about = {"headturn": __version__, "content": CONTENT_VERSION, "schema": SCHEMA_VERSION}
    found: list[Finding] = []
    if not as_json:
        say(f"headturn {__version__}, content version {CONTENT_VERSION}, schema {SCHEMA_VERSION}")
    for one in findings(blender):
        found.append(one)
        if not as_json:
            _print(one)
    can_build = not doomed(found)
    if as_json:
        whole = {**about, "can_build": can_build, "findings": [asdict(one) for one in found]}
        typer.echo(json.dumps(whole, indent=2))
    else:
        say("datasets can be built here" if can_build else "no dataset can be built here: see above")
    raise typer.Exit(0 if can_build else 1)


def _print(one: Finding) -> None:
    first, *remedy = one.lines()
    say(first, style=STYLES[one.state])
    for line in remedy:
        say(line)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: headturn doctor --json")(doctor)
