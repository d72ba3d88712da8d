# SPDX-License-Identifier: GPL-3.0-or-later
"""Dataclasses to plain JSON values and back, by their type hints. stdlib and numpy only.

A field that has its default is left out: so a field that is added later changes no message, and no
hash of one, in which it is not used.
"""

from __future__ import annotations

import base64
import types
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")


def to_plain(value: Any) -> Any:
    """A value as JSON has it. Arrays become the text of their little-endian bytes, with type and shape.

    Raises TypeError for what has no such form.
    """
    if is_dataclass(value) and not isinstance(value, type):
        every = ((field, getattr(value, field.name)) for field in fields(value))
        return {field.name: to_plain(v) for field, v in every if not _is_default(field, v)}
    if isinstance(value, np.ndarray):
        kind = value.dtype.newbyteorder("<").str
        data = base64.b64encode(np.ascontiguousarray(value, dtype=kind).tobytes()).decode("ascii")
        return {"dtype": kind, "shape": list(value.shape), "data": data}
    if isinstance(value, (list, tuple)):
        return [to_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, (str, bool, int, float)):
        return value
    raise TypeError(f"no plain form of {type(value).__name__}")


def from_plain(kind: type[T], value: Any) -> T:
    """The inverse of :func:`to_plain` for a class or a type hint.

    Raises TypeError or ValueError for what is no such thing.
    """
    return cast(T, _from(kind, value))


def _from(kind: Any, value: Any) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        return _from(next(a for a in arguments if a is not type(None)), value)
    if (kind is np.ndarray or is_dataclass(kind) or origin is dict) and not isinstance(value, Mapping):
        raise TypeError(f"expected an object, got {str(value)[:80]!r}")
    if kind is np.ndarray:
        if missing := {"dtype", "shape", "data"} - set(value):
            raise TypeError(f"an array has no {', '.join(sorted(missing))}")
        flat = np.frombuffer(base64.b64decode(value["data"]), dtype=value["dtype"])
        return flat.reshape(value["shape"]).copy()
    if isinstance(kind, type) and is_dataclass(kind):
        hints = _hints(kind)
        if unknown := set(value) - set(hints):
            raise TypeError(f"{kind.__name__} has no {', '.join(sorted(unknown))}")
        return kind(**{name: _from(hints[name], item) for name, item in value.items()})
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is ...:
            return tuple(_from(arguments[0], item) for item in value)
        return tuple(_from(inner, item) for inner, item in zip(arguments, value, strict=True))
    if origin is dict:
        return {key: _from(arguments[1], item) for key, item in value.items()}
    if kind in (str, int, bool) and type(value) is not kind:
        raise TypeError(f"expected {kind.__name__}, got {str(value)[:80]!r}")
    return kind(value) if kind in (Path, float) else value


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _is_default(field: Field[Any], value: Any) -> bool:
    if field.default is not MISSING:
        return type(value) is type(field.default) and bool(value == field.default)
    if field.default_factory is not MISSING:
        return bool(value == field.default_factory())
    return False
