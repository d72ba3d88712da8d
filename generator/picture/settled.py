# SPDX-License-Identifier: GPL-3.0-or-later
"""A configuration whose environments and pictures are named one by one, with the hash of their bytes.

So draws depend on no folder, verify needs none, and units have another name where a file has other bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from generator.errors import UsageError
from generator.escape import quoted
from generator.picture.files import PANORAMAS, PICTURES, named_files, packaged_panoramas, read_file
from generator.plan.config import BuildConfig
from generator.plan.distribution import Distribution
from generator.plan.render_settings import BACKDROPS, ENVIRONMENT, NOTHING, PICTURE
from generator.plan.thing import SUFFIXES, content
from generator.plan.wear import LENSES, STYLES

ALL = "all"


def settled(config: BuildConfig) -> BuildConfig:
    """The configuration with every name that its environments, backdrops, pictures and wear may have.

    Raises UsageError: there is no such name or folder, or a file cannot be read.
    """
    for kind, styles in {**STYLES, "lenses": LENSES}.items():
        config = _styled(config, kind, styles)
    environments = _texts(config, "environment")
    backdrops = _texts(config, "backdrop")
    if unknown := [name for name in backdrops if name not in BACKDROPS]:
        raise UsageError(f"render.backdrop: no backdrop {quoted(unknown[0])}; {_there_are(BACKDROPS)}")
    if ENVIRONMENT in backdrops and {*environments} == {NOTHING}:
        raise UsageError("render.backdrop: it shows the environment, and there is none; give --environment")
    digest = hashlib.sha256()
    if any(name != NOTHING for name in environments):
        found = named_files(environment_folder(config), PANORAMAS, "render.environments")
        config = _named(config, "environment", found, digest, (NOTHING,))
    if PICTURE in backdrops:
        if config.render.pictures is None:
            raise UsageError("render.backdrop: no folder of pictures is given; name one in --pictures")
        found = named_files(picture_folder(config), PICTURES, "render.pictures")
        config = _named(config, "backdrop_picture", found, digest, ())
    if any(name != NOTHING for name in _texts(config, "thing")):
        if config.render.things is None:
            raise UsageError("render.thing: no folder of things is given; name one in --things")
        found = named_files(config.located(config.render.things), SUFFIXES, "render.things")
        config = _named(config, "thing", found, digest, (NOTHING,), content)
    used = digest.hexdigest() if digest.digest() != hashlib.sha256().digest() else ""
    return replace(config, render=replace(config.render, files_sha256=used))


def environment_folder(config: BuildConfig) -> Path:
    """Where the panoramas are. Raises UsageError if none is given and there are none of Blender's."""
    given = config.render.environments
    return config.located(given) if given else packaged_panoramas()


def picture_folder(config: BuildConfig) -> Path:
    """Where the pictures are: the working directory, if none is given and none is asked for."""
    return config.located(config.render.pictures or "")


def check_files(config: BuildConfig) -> None:
    """Are the files that a settled configuration names still the same? Raises UsageError if not."""
    if settled(config).render.files_sha256 != config.render.files_sha256:
        given = config.render
        where = [*filter(None, (given.environments, given.pictures, given.things))]
        what = "panoramas, pictures or things" if given.things else "panoramas or pictures"
        raise UsageError(f"{', '.join(where) or 'Blender'}: its {what} are others than then")


def _texts(config: BuildConfig, key: str) -> tuple[str, ...]:
    """Every value that a setting of texts may have, as they are written."""
    drawn = config.drawn.get(f"render.{key}")
    return drawn.texts if drawn else (getattr(config.render, key),)


def _named(
    config: BuildConfig,
    key: str,
    files: dict[str, Path],
    digest: hashlib._Hash,
    others: Sequence[str],
    read: Callable[[Path], bytes] | None = None,
) -> BuildConfig:
    """The configuration with the names of files for "all", or for nothing; the digest learns of each.

    read: what decides a file's look, if not its bytes.
    """
    texts = _texts(config, key)
    for name in dict.fromkeys(name for text in texts for name in (files if text in (ALL, "") else (text,))):
        if name in others:
            continue
        if name not in files:
            near = get_close_matches(name, files, 3) or [*files][:10]
            raise UsageError(f"render.{key}: no {quoted(name)}; {_there_are(near)}")
        path = files[name]
        found = hashlib.sha256(read(path) if read else read_file(path, f"render.{key}")).hexdigest()
        digest.update(f"{key} {name}\0{found}\n".encode())
    return _chosen(config, key, texts, tuple(files))


def _styled(config: BuildConfig, kind: str, styles: Sequence[str]) -> BuildConfig:
    """The configuration with every style for "all"."""
    texts = _texts(config, kind)
    if unknown := [text for text in texts if text not in (*styles, ALL)]:
        raise UsageError(f"render.{kind}: no {kind} {quoted(unknown[0])}; {_there_are(styles)}")
    return _chosen(config, kind, texts, styles) if ALL in texts else config


def _chosen(config: BuildConfig, key: str, texts: Sequence[str], every: Sequence[str]) -> BuildConfig:
    """The configuration with a choice of texts, each of every for "all" or nothing."""
    names = tuple(name for text in texts for name in (every if text in (ALL, "") else (text,)))
    drawn = config.drawn.get(f"render.{key}")
    first: dict[str, Any] = {key: names[0]}
    render = replace(config.render, **first)
    if drawn is None and len(names) == 1:
        return replace(config, render=render)
    choice = Distribution("choice", per_head=bool(drawn and drawn.per_head), texts=names)
    return replace(config, render=render, drawn={**config.drawn, f"render.{key}": choice})


def _there_are(names: Sequence[str]) -> str:
    return f"there are {', '.join(names)}" if names else "there is none"
