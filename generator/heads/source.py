# SPDX-License-Identifier: GPL-3.0-or-later
"""One door to every head source."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from generator import registries
from generator.errors import HeadError, UsageError
from generator.escape import quoted
from generator.heads.facescape import EXPRESSIONS, expression_number
from generator.heads.folders import ARCHIVES, SUFFIXES, UNKNOWN_LICENSE
from generator.heads.head import SCENE, Finder, Head, HeadSource, SkippedHead
from generator.heads.units import MM_PER_UNIT, axes_rotation, axis_vector
from generator.names import is_text


def find_heads(
    path: Path,
    *,
    expressions: Sequence[str] | None = None,
    license: str | None = None,
    redistributable: bool | None = None,
    units: str | None = None,
    up: str | None = None,
    forward: str | None = None,
    eye_distance_mm: float | None = None,
    without: Sequence[str] | None = None,
    head_object: str | None = None,
) -> HeadSource:
    """The heads under ``path``, numbers in numerical order. Meshes are not parsed.

    Parameters
    ----------
    path: a FaceScape download (or any folder of it), a mesh file, a folder of
        meshes, or a folder of such folders up to three deep.
    expressions: which to take, by name ("smile"), FaceScape number ("2") or
        both ("2_smile"); None takes all.
    license, redistributable, units, up, forward: override what the source says
        or what would be guessed. FaceScape's licence cannot be overridden.
    eye_distance_mm, without: of every head; see :class:`Head`.
    head_object: which object or collection of a Blender scene is the head.

    Raises
    ------
    UsageError: no such path, no heads in it, an unknown expression or unit,
        impossible axes, or an attempt to widen FaceScape's licence.
    """
    path = Path(path).absolute()
    if ".." in path.parts:
        path = path.resolve()
    if not path.exists():
        raise UsageError(f"no such file or folder: {path}")
    if not is_text(str(path)):
        raise UsageError(f"{path}: the path holds bytes that are no text in UTF-8; rename it")
    if units is not None and units not in MM_PER_UNIT:
        raise UsageError(f"unknown unit {units!r}; one of {', '.join(MM_PER_UNIT)}")
    for text, option in ((up, "--up"), (forward, "--forward")):
        if text is not None:
            axis_vector(text, option)
    if up is not None and forward is not None:
        axes_rotation(up, forward)
    try:
        kind, finder, heads, skipped = _search(path, head_object)
    except (HeadError, OSError) as error:
        raise UsageError(f"{path} cannot be searched: {error}") from error
    if not heads and not skipped:
        raise UsageError(_nothing_found(path))
    if finder.license and (redistributable or license not in (None, finder.license)):
        raise UsageError(
            f"{path} is {kind}, whose licence is {finder.license}; remove --license and --redistributable"
        )
    heads, skipped = _recordable(heads, skipped)
    if without and any(head.source == SCENE for head in heads):
        raise UsageError(f"{path}: a scene is rendered as it stands; hide in Blender what --without names")
    if expressions is not None:
        heads, skipped = _select(heads, skipped, expressions)
    given = [
        replace(
            head,
            license=head.license if license is None else license,
            redistributable=head.redistributable if redistributable is None else redistributable,
            units=units or head.units,
            up=up or head.up,
            forward=forward or head.forward,
            eye_distance_mm=eye_distance_mm,
            without=tuple(without or ()),
            problems=tuple(p for p in head.problems if p != UNKNOWN_LICENSE or license is None),
        )
        for head in heads
    ]
    return HeadSource(path, kind, tuple(given), tuple(skipped))


def _recordable(heads: list[Head], skipped: list[SkippedHead]) -> tuple[list[Head], list[SkippedHead]]:
    """Heads that a dataset can name: what is written down of them is text, and no two share a file's name.

    Some file systems do not tell upper case from lower; of names that are one there the first is taken.
    """
    first: dict[tuple[str, ...], str] = {}
    taken, others = [], []
    for head in heads:
        if reason := _no_text(head) or _no_other_name(head, first):
            others.append(SkippedHead(head.subject, head.expression, head.mesh_path, reason))
        else:
            taken.append(head)
    return taken, [*skipped, *others]


def _no_text(head: Head) -> str:
    for text in (head.license, head.attribution, *map(str, head.files)):
        if not is_text(text):
            return f"{quoted(Path(text).name)} holds bytes that are no text in UTF-8; rename it"
    return ""


def _no_other_name(head: Head, first: dict[tuple[str, ...], str]) -> str:
    subject, expression = _plain(head.subject), _plain(head.expression)
    for key, name in (((subject,), head.subject), ((subject, expression), head.expression)):
        if (other := first.setdefault(key, name)) != name:
            return f"{quoted(name)} and {quoted(other)} are one file name on some systems; rename one"
    return ""


def _plain(name: str) -> str:
    """What is left of a name where upper and lower case, or ways to write a character, are not told apart."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())


def _search(path: Path, head_object: str | None) -> tuple[str, Finder, list[Head], list[SkippedHead]]:
    """The first kind of source that finds something, and what it finds; else the last kind."""
    for kind in registries.HEAD_FINDERS:
        finder: Finder = registries.HEAD_FINDERS.get(kind)
        heads, skipped = finder.choose(path, head_object or "") if finder.choose else finder.find(path)
        if heads or skipped:
            break
    if head_object and not finder.choose:
        raise UsageError(f"{path} is no Blender scene, so there is nothing to choose; remove --head-object")
    sources = {head.source for head in heads}
    return (sources.pop() if len(sources) == 1 else kind), finder, heads, skipped


def _nothing_found(path: Path) -> str:
    if path.suffix.lower() in ARCHIVES and path.is_file():
        return f"{path} is an archive: unpack it, and name the folder"
    # Downloads hold them a folder or two down.
    below = (entry for depth in ("*", "*/*", "*/*/*") for entry in sorted(path.glob(depth)))
    archive = next((entry for entry in below if entry.suffix.lower() in ARCHIVES and entry.is_file()), None)
    if archive is not None:
        return f"no heads in {path}, but the archive {archive.relative_to(path)}: unpack it first"
    return f"no heads in {path}; expected {', '.join(SUFFIXES)} files or FaceScape's numbered folders"


def _select(
    heads: list[Head], skipped: list[SkippedHead], wanted: Sequence[str]
) -> tuple[list[Head], list[SkippedHead]]:
    """Heads of the wanted expressions; subjects that lack one are skipped with that reason."""
    existing = {head.expression for head in heads} | {head.expression for head in skipped}
    chosen = dict.fromkeys(_resolve(text, existing) for text in wanted)
    taken = [head for head in heads if head.expression in chosen]
    missed = [head for head in skipped if head.expression in chosen]
    known = {(h.subject, h.expression) for h in taken} | {(h.subject, h.expression) for h in missed}
    for subject, first in {h.subject: h for h in reversed(heads)}.items():
        missed += [
            SkippedHead(subject, expression, first.mesh_path.parent, f"this subject has no {expression!r}")
            for expression in chosen
            if (subject, expression) not in known
        ]
    return taken, missed


def _resolve(text: str, existing: set[str]) -> str:
    """The expression a user means."""
    plain = text.strip()
    for expression in sorted(existing):
        number = expression_number(expression)
        names = {expression.casefold()} | ({str(number), f"{number}_{expression}"} if number else set())
        if plain.casefold() in names:
            return expression
    order = {name: i for i, name in enumerate(EXPRESSIONS)}
    listed = sorted(existing, key=lambda name: (order.get(name, len(order)), name))
    raise UsageError(f"unknown expression {text!r}; there are: {', '.join(listed)}")
