# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of the command line that are settings: made from their table, and turned into values again."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import typer

from generator.errors import UsageError
from generator.escape import shortened
from generator.plan.distribution import is_distribution
from generator.plan.setting import Setting
from generator.plan.settings import Values

SHOWN_CHOICES = 6
"""How many choices stand in the place of a value; more are in the message of a wrong one."""


def with_settings(
    command: Callable[..., None], settings: Iterable[Setting], defaults: Mapping[str, Any] | None = None
) -> Callable[..., None]:
    """The command with an option for every flag of settings; it gets what was given as ``overrides``.

    defaults: by "section.key", where they are not the settings' own.
    """
    flags: dict[str, list[Setting]] = {}
    for setting in settings:
        if setting.flag:
            flags.setdefault(setting.flag, []).append(setting)
    hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name != "overrides"
    ]
    added = {_name(flag): _parameter(flag, group, defaults or {}) for flag, group in flags.items()}

    def run(**given: Any) -> None:
        values = {flag: given.pop(_name(flag)) for flag in flags}
        command(**given, overrides=values_of(values, flags))

    parameters = [*own, *added.values()]
    run.__doc__, run.__name__ = command.__doc__, command.__name__
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def values_of(given: Mapping[str, Any], flags: Mapping[str, list[Setting]]) -> Values:
    """What options say, as section -> key -> value; None and empty lists say nothing.

    UsageError names the option.
    """
    values: Values = {}
    for flag, value in given.items():
        if value is None or value == []:
            continue
        group = flags[flag]
        for setting, part in zip(group, _parts(flag, group, value), strict=True):
            if part is not None:
                values.setdefault(setting.section, {})[setting.key] = part
    return values


def numbers(option: str, text: str) -> list[float]:
    """Numbers separated by commas. UsageError names the option."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise UsageError(f"{option} {text!r}: expected numbers separated by commas") from error


def pose_source(text: str) -> dict[str, Any]:
    """Settings of a plan named grid, uniform:N, sobol:N, or by the path of a CSV file."""
    kind, _, count = text.partition(":")
    if kind == "grid" and not count:
        return {"kind": "grid"}
    if kind in ("uniform", "sobol"):
        if not count.isdecimal() or len(count) > 20:
            raise UsageError(f"--poses {shortened(repr(text))}: say how many, such as {kind}:500")
        return {"kind": kind, "count": int(count)}
    return {"kind": "csv", "path": text}


def _parts(flag: str, group: list[Setting], value: Any) -> list[Any]:
    """The value of each setting of a flag."""
    if flag == "--poses":
        told = pose_source(value)
        return [told.get(setting.key) for setting in group]
    if group[0].kind is str and group[0].info.varies:
        return [value] * len(group)
    if all(setting.info.varies for setting in group) and is_distribution(value):
        numbers_of_one = get_args(_inner(group[0].kind))
        if numbers_of_one:
            return [_distributions(flag, [group[0].key] * len(numbers_of_one), value)]
        return _distributions(flag, [setting.key for setting in group], value)
    if _first_and_further(group):
        first, *further = value.split(",")
        return [first, further or None]
    if len(group) > 1 and len({setting.section for setting in group}) == 1:
        parts = numbers(flag, value)
        if len(parts) != len(group):
            example = ",".join(f"{setting.default:g}" for setting in group)
            raise UsageError(f"{flag} {value!r}: expected {len(group)} numbers, such as {example}")
        return list(parts)
    kind = _inner(group[0].kind)
    if get_origin(kind) is tuple and isinstance(value, str):
        value = value.split(",") if str in get_args(kind) else numbers(flag, value)
    elif group[0].info.varies and isinstance(value, str):
        [value] = _one_number(flag, value)
    return [value] * len(group)


def _distributions(flag: str, names: list[str], text: str) -> list[Any]:
    """A number or a distribution for each name, with semicolons between them."""
    parts = text.split(";")
    if len(parts) != len(names):
        said = " and ".join(dict.fromkeys(names))
        raise UsageError(
            f"{flag} {shortened(repr(text))}: expected {len(names)} parts with ; between: {said}"
        )
    return [part if is_distribution(part) else _one_number(flag, part)[0] for part in parts]


def _one_number(flag: str, text: str) -> list[float]:
    found = numbers(flag, text)
    if len(found) != 1:
        raise UsageError(
            f"{flag} {shortened(repr(text))}: expected a number, or a distribution such as uniform:1,2"
        )
    return found


def _parameter(flag: str, group: list[Setting], defaults: Mapping[str, Any]) -> inspect.Parameter:
    first = group[0]
    default = defaults.get(first.name)
    names, metavar = [flag], None
    kind = _inner(first.kind)
    if kind is bool:
        names = [f"{flag}/--not-{flag.removeprefix('--')}"]
    elif len(group) > 1 and (flag == "--poses" or _first_and_further(group)):
        kind = str
    elif len(group) > 1 and len({s.section for s in group}) == 1:
        kind, metavar = str, ",".join(s.key.upper().removesuffix("_DEG").split("_")[-1] for s in group)
    elif first.info.varies:
        several = "S" if get_origin(kind) is tuple else ""
        kind, metavar = str, "TEXT|choice:A,B" if kind is str else f"NUMBER{several}|DISTRIBUTION{several}"
    elif get_origin(kind) is tuple:
        kind = list[str] if str in get_args(kind) and not first.choices else str
    elif get_origin(kind) is not None:  # a Literal of texts
        kind = str
    if kind is str and not metavar and 0 < len(first.choices) <= SHOWN_CHOICES and flag != "--poses":
        metavar = "|".join(choice.value for choice in first.choices)
    option = typer.Option(
        *names,
        metavar=metavar,
        help=_help(group, said=default is None),
        rich_help_panel=f"Settings: {first.section}",
        show_default=default is not None,
    )
    annotation: Any = Annotated[Union[kind, None], option]  # type: ignore[valid-type]  # noqa: UP007
    return inspect.Parameter(
        _name(flag), inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
    )


def _help(group: list[Setting], said: bool) -> str:
    """A line: what it is, its unit, and if it is to be said, its default."""
    first, info = group[0], group[0].info
    unit = f" ({info.unit})" if info.unit else ""
    usual = ",".join(_shown(s.default) for s in group) if len({s.section for s in group}) == 1 else ""
    if _first_and_further(group):
        usual = str(first.default)
    if not said or first.flag == "--poses" or first.default in (None, ()):
        usual = ""
    text = f"{info.help}{unit}{f'; default {usual}' if usual else ''}"
    return text if text.endswith("?") else f"{text}."


def _first_and_further(group: list[Setting]) -> bool:
    """Whether a flag takes a name and, after commas, further ones."""
    return [setting.kind for setting in group] == [str, tuple[str, ...]]


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return ""
    if isinstance(value, tuple):
        return ",".join(map(_shown, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _inner(kind: Any) -> Any:
    """The type without its None."""
    arguments = [a for a in get_args(kind) if a is not type(None)]
    return arguments[0] if type(None) in get_args(kind) else kind


def _name(flag: str) -> str:
    return flag.removeprefix("--").replace("-", "_")
