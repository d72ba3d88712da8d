# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for things that come in kinds: a new one is a file, and a line in :mod:`generator.registries`.

stdlib only, and nothing is imported before it is asked for: Blender reads names from here too.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any, Generic, TypeVar, cast

from generator.errors import UsageError

T = TypeVar("T")


class Registry(Generic[T]):
    """Objects by name, each given as "module:attribute" and imported when it is first asked for.

    what: the option or setting that chooses one, for messages.
    """

    def __init__(self, what: str, entries: dict[str, str]) -> None:
        self.what = what
        self._entries: dict[str, Any] = dict(entries)

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in the order in which they were given."""
        return tuple(self._entries)

    def get(self, name: str) -> T:
        """What is called so. UsageError, with the names there are, if nothing is."""
        if name not in self._entries:
            raise UsageError(f"{self.what} {name!r}: expected one of {', '.join(self._entries)}")
        found = self._entries[name]
        if isinstance(found, str):
            module, _, attribute = found.partition(":")
            if module.startswith("generator."):  # Blender's extension has a copy of it under its own name
                module = f"{__package__}{module.removeprefix('generator')}"
            found = getattr(import_module(module), attribute)
        return cast(T, found)

    def add(self, name: str, entry: T | str) -> None:
        """Add one, such as a detector of the user's own: the object, or "module:attribute"."""
        self._entries[name] = entry

    def remove(self, name: str) -> None:
        """Take one away. KeyError if there is none."""
        del self._entries[name]
