# SPDX-License-Identifier: GPL-3.0-or-later
"""The build configuration: one TOML file, or the flags that say the same; settings.py says what may
stand in it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from generator.errors import UsageError
from generator.escape import shortened
from generator.plan.distribution import (
    Distribution,
    is_choice,
    is_distribution,
    parse_choice,
    parse_distribution,
)
from generator.plan.head_source import is_made, split_path
from generator.plan.setting import Choice, Setting
from generator.plan.settings import (
    SECTIONS,
    Dataset,
    Heads,
    Landmarks,
    Poses,
    Render,
    Values,
    all_settings,
    plain,
    section_settings,
)
from generator.plan.variety import NONE, VARIETY
from generator.platforms import relative_path
from generator.reading import MAX_CONFIG_BYTES, parse_toml, read_text


@dataclass(frozen=True)
class BuildConfig:
    """Everything that decides a dataset's content, and nothing else.

    drawn: by "section.key", what a setting is drawn from; the setting itself then holds the middle. By
    "section.key.place" where the setting has several numbers, of which each may be drawn.
    base: where relative paths count from: the folder of the configuration file, the working
    directory for flags.
    """

    heads: Heads = field(default_factory=Heads)
    poses: Poses = field(default_factory=Poses)
    render: Render = field(default_factory=Render)
    landmarks: Landmarks = field(default_factory=Landmarks)
    dataset: Dataset = field(default_factory=Dataset)
    drawn: Mapping[str, Distribution] = field(default_factory=dict)
    base: Path = field(default_factory=Path.cwd, compare=False)

    def as_dict(self) -> Values:
        """Plain values for JSON, section by section; distributions as they are written."""
        values = {name: plain_values(getattr(self, name)) for name in SECTIONS}
        for name, distribution in self.drawn.items():
            section, key, *place = name.split(".")
            if place:
                values[section][key][int(place[0])] = distribution.text
            else:
                values[section][key] = distribution.text
        return values

    @property
    def makes_heads(self) -> bool:
        """Are the heads made on the spot?"""
        return is_made(self.heads.source)

    def located(self, path: str) -> Path:
        """A path setting as an absolute path."""
        return Path(os.path.abspath(self.base / path))

    @property
    def detecting(self) -> Landmarks:
        """What a lane is told of landmarks: its file as an absolute path."""
        file = self.landmarks.file
        return self.landmarks if file is None else replace(self.landmarks, file=str(self.located(file)))

    def moved_to(self, root: Path) -> BuildConfig:
        """The same configuration as a file in the folder root says it: relative paths count from there."""
        values = self.as_dict()
        for setting in _paths(values):
            before, path = split_path(values[setting.section][setting.key])
            if not Path(path).is_absolute():
                values[setting.section][setting.key] = before + relative_path(self.located(path), root)
        return replace(_validated(values, "configuration"), base=root)


def load_config(path: Path | None, overrides: Mapping[str, Mapping[str, Any]]) -> BuildConfig:
    """Read a TOML file and lay the flags over it.

    Parameters
    ----------
    path: None means all defaults. Relative paths in it count from its folder.
    overrides: section -> key -> value. Relative paths in it count from the working directory.

    Raises
    ------
    UsageError: the file is missing or not TOML, a key is unknown, a value is
        out of range.
    """
    values: dict[str, Any] = {}
    base = Path.cwd()
    if path is not None:
        values, base = _read_toml(path), path.absolute().parent
    for section, changes in overrides.items():
        merged = values.setdefault(section, {})
        if not isinstance(merged, dict):
            raise UsageError(f"{path}: [{section}] must be a table")
        merged.update(changes)
    if path is not None:
        for setting in _paths(overrides):
            before, named = split_path(overrides[setting.section][setting.key])
            values[setting.section][setting.key] = before + str(Path(named).absolute())
    render = values.get("render", {})
    if isinstance(render, dict):
        # What it stands for is recorded, and not its name: a later release may vary otherwise.
        stands_for = VARIETY.get(str(render.get("variety")), {})
        settled = {"variety": NONE} if stands_for else {}
        values = {**values, "render": {**stands_for, **render, **settled}}
    return replace(_validated(values, path or "configuration"), base=base)


def recorded_config(values: Values, root: Path) -> BuildConfig:
    """The configuration that a dataset in the folder root recorded: its paths count from there.

    Datasets of the first release say nothing of poses.same, which they were. Their paths counted from
    the working directory of the build: where nothing lies there as seen from root, they count from the
    one of this process. Raises UsageError as :func:`load_config` does.
    """
    poses = values.get("poses", {})
    if isinstance(poses, Mapping):
        values = {**values, "poses": {"same": True, **poses}}
    for setting in _paths(values):
        before, path = split_path(values[setting.section][setting.key])
        value = Path(path)
        if not value.is_absolute() and not (root / value).exists() and value.exists():
            section = {**values[setting.section], setting.key: before + str(value.absolute())}
            values = {**values, setting.section: section}
    return replace(_validated(values, root), base=root)


def read_recorded(file: Path) -> BuildConfig:
    """:func:`recorded_config` of the file config.toml of a dataset."""
    return recorded_config(_read_toml(file), file.parent)


def config_toml(config: BuildConfig) -> str:
    """The resolved configuration as TOML; None values are left out, as TOML has none."""
    values = config.as_dict()
    return tomli_w.dumps(
        {name: {k: v for k, v in table.items() if v is not None} for name, table in values.items()}
    )


def drawn_in(values: Mapping[str, Any], where: object) -> dict[str, Distribution]:
    """By "section.key", what the settings of a configuration are drawn from, whatever else it holds.

    where: what messages call it. Raises UsageError: a distribution is none.
    """
    return _split(plain(dict(values)), where)[1]


def differences(ours: BuildConfig, theirs: BuildConfig) -> dict[str, str]:
    """ "section.key" -> "section.key: theirs -> ours" of each setting that differs."""
    found = {}
    for setting in all_settings():
        a, b = (_comparable(config, setting) for config in (theirs, ours))
        if a != b:
            found[setting.name] = f"{setting.name}: {a!r} -> {b!r}"
    return found


def plain_values(section: Any) -> dict[str, Any]:
    """The settings of one section as JSON has them."""
    return {key: plain(value) for key, value in asdict(section).items()}


def _comparable(config: BuildConfig, setting: Setting) -> Any:
    value = config.as_dict()[setting.section][setting.key]
    if setting.info.path and value is not None:
        before, path = split_path(value)
        return before + str(config.located(path)) if path else value
    return value


def _paths(values: Mapping[str, Any]) -> list[Setting]:
    """The settings of paths that are given."""
    return [
        known
        for known in all_settings()
        if known.info.path
        and isinstance(values.get(known.section), Mapping)
        and isinstance(values[known.section].get(known.key), str)
        and split_path(values[known.section][known.key])[1]
    ]


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return parse_toml(read_text(path, MAX_CONFIG_BYTES))
    except FileNotFoundError as error:
        raise UsageError(f"{path}: there is no such configuration file") from error
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise UsageError(f"{path}: not a TOML configuration: {error}") from error


def _validated(values: Mapping[str, Any], where: object) -> BuildConfig:
    whole = _whole_model(tuple(SECTIONS.items()), tuple(known.choices for known in all_settings()))
    fixed, drawn = _split(plain(dict(values)), where)
    try:
        found = whole.model_validate(fixed)
    except ValidationError as error:
        first = error.errors()[0]
        *section, name = (str(part) for part in first["loc"])
        place = ".".join([*section, name])
        if first["type"] == "extra_forbidden":
            kind = "setting" if section else "section"
            known = [one.key for one in all_settings() if [one.section] == section] or [*SECTIONS]
            near = ", ".join(get_close_matches(name, known, 1) or known)
            raise UsageError(f"{where}: {place}: no such {kind}; there is {near}") from error
        given = "" if first["type"] == "missing" else f", got {shortened(repr(first['input']))}"
        raise UsageError(f"{where}: {place}: {first['msg']}{given}") from error
    sections = {name: section(**dict(getattr(found, name))) for name, section in SECTIONS.items()}
    return BuildConfig(**sections, drawn=drawn)


def _split(values: dict[str, Any], where: object) -> tuple[dict[str, Any], dict[str, Distribution]]:
    """Values with the middle of every distribution in its place, and the distributions by "section.key"."""
    drawn: dict[str, Distribution] = {}
    for setting in all_settings():
        table = values.get(setting.section)
        if not (setting.info.varies and isinstance(table, dict)):
            continue
        given, of_several = table.get(setting.key), get_origin(setting.kind) is tuple
        if setting.key not in table or of_several != isinstance(given, list):
            continue
        parts: list[Any] = list(given or ()) if of_several else [given]
        for place, part in enumerate(parts):
            if (found := _distribution(setting, part, where)) is not None:
                drawn[f"{setting.name}.{place}" if of_several else setting.name] = found
                parts[place] = found.middle
        middle = parts if of_several else parts[0]
        values = {**values, setting.section: {**values[setting.section], setting.key: middle}}
    return values, drawn


def _distribution(setting: Setting, given: Any, where: object) -> Distribution | None:
    """The distribution that stands where a value may; None for a value."""
    of_texts = setting.kind is str
    if not (is_choice(given) if of_texts else is_distribution(given)):
        return None
    try:
        low, high = setting.info.low, setting.info.high
        return parse_choice(given) if of_texts else parse_distribution(given, low, high)
    except ValueError as error:
        raise UsageError(f"{where}: {setting.name}: {shortened(str(error))}") from error


@lru_cache(maxsize=16)
def _whole_model(
    sections: tuple[tuple[str, type], ...], choices: tuple[tuple[Choice, ...], ...]
) -> type[BaseModel]:
    """What pydantic checks. Making it takes longer than using it, so it is made once.

    choices: of every setting; some follow from registries, which may grow.
    """
    models = {name: _model(name, section) for name, section in sections}
    every: dict[str, Any] = {name: (model, model()) for name, model in models.items()}
    return create_model("configuration", __config__=ConfigDict(extra="forbid"), **every)


def _model(name: str, section: type) -> type[BaseModel]:
    """What pydantic checks of one section."""
    made: dict[str, Any] = {
        setting.key: (_checked(setting.kind, setting), setting.default)
        for setting in section_settings(name, section)
    }
    return create_model(name, __config__=ConfigDict(extra="forbid"), **made)


def _checked(kind: Any, setting: Setting) -> Any:
    """The type of a setting with its limits, on each number of a list."""
    arguments = get_args(kind)
    if type(None) in arguments:
        return Union[_checked(arguments[0], setting), None]  # noqa: UP007  built at run time
    if get_origin(kind) is tuple:
        inner = tuple(_checked(inner, setting) if inner is not ... else ... for inner in arguments)
        return tuple[inner]  # type: ignore[valid-type]
    if kind is str and setting.choices:
        return Literal[tuple(choice.value for choice in setting.choices)]
    info = setting.info
    if (info.low, info.high, info.above) == (None, None, None):
        return kind
    return Annotated[kind, Field(ge=info.low, le=info.high, gt=info.above)]
