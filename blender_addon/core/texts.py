# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that are texts, choices of texts, or yes and no."""

from __future__ import annotations

from typing import Any

from generator import registries
from generator.plan.head_source import is_made, split_path
from generator.plan.setting import Setting

from .config import join_names, same, split_names
from .field import Field, Get, Property
from .words import GUESSED, HELP, LABELS, NOT_GIVEN, titled

GUESS = "GUESS"
"""The item of a choice that is not given."""

FOLDER = "FOLDER"
"""The item of heads that lie on the disk."""

MESHES = (
    *(".obj", ".ply", ".glb", ".gltf", ".vrm", ".fbx", ".dae", ".usd", ".usda", ".usdc", ".usdz", ".stl"),
)
"""Endings of files that hold a head."""

EXPANDED, ABREAST = 3, 26
"""So many choices stand side by side, if their names have no more letters; others are a menu."""


class Switch(Field):
    """bool."""

    def properties(self) -> dict[str, Property]:
        return {self.name: Property("BoolProperty", {**self.words, "default": bool(self.setting.default)})}


class Text(Field):
    """str; an empty field is one that is not given."""

    @property
    def style(self) -> str:
        return "text"

    @property
    def paths(self) -> tuple[str, ...]:
        return (self.name,) if self.setting.info.path else ()

    def properties(self) -> dict[str, Property]:
        options = {**self.words, "default": self.setting.default or ""}
        if self.paths:
            options["subtype"] = "FILE_PATH"
        return {self.name: Property("StringProperty", options)}

    def value(self, get: Get) -> Any:
        return get(self.name) or (None if self.optional else "")


class Names(Field):
    """Several texts, separated by commas."""

    @property
    def style(self) -> str:
        return "text"

    def properties(self) -> dict[str, Property]:
        default = join_names(self.setting.default or ())
        return {self.name: Property("StringProperty", {**self.words, "default": default})}

    def value(self, get: Get) -> Any:
        return split_names(get(self.name)) or (None if self.optional else [])

    def properties_of(self, value: Any) -> dict[str, Any]:
        return {self.name: join_names(value)}


class Choice(Field):
    """One of some texts, or bool | None; GUESS is none of them."""

    @property
    def style(self) -> str:
        if self.kind is bool:
            return "menu"  # Yes and No say nothing without their name
        letters = sum(len(name) for _, name, _ in self._items)
        return "expanded" if len(self._items) <= EXPANDED and letters <= ABREAST else "menu"

    @property
    def _items(self) -> tuple[tuple[str, str, str], ...]:
        guess = ((GUESS, *NOT_GIVEN.get(self.setting.name, GUESSED)),) if self.optional else ()
        if self.kind is bool:
            return (*guess, ("YES", "Yes", ""), ("NO", "No", ""))
        return (*guess, *_items(self.setting))

    def properties(self) -> dict[str, Property]:
        [default] = self.properties_of(self.setting.default).values()
        return {self.name: Property("EnumProperty", {**self.words, "items": self._items, "default": default})}

    def value(self, get: Get) -> Any:
        found = get(self.name)
        if self.kind is bool:
            return {"YES": True, "NO": False}.get(found)
        return None if found == GUESS else found

    def properties_of(self, value: Any) -> dict[str, Any]:
        if isinstance(value, bool):
            value = "YES" if value else "NO"
        return {self.name: GUESS if value is None else value}


class Choices(Field):
    """Any number of some texts."""

    @property
    def style(self) -> str:
        return "flags"

    def properties(self) -> dict[str, Property]:
        options = {"items": _items(self.setting), "default": set(self.setting.default or ())}
        return {self.name: Property("EnumProperty", {**self.words, **options, "options": {"ENUM_FLAG"}})}

    def value(self, get: Get) -> Any:
        chosen = get(self.name)
        found = [choice.value for choice in self.setting.choices if choice.value in chosen]
        return found or (None if self.optional else [])

    def properties_of(self, value: Any) -> dict[str, Any]:
        return {self.name: set(value)}

    def shows(self, told: Any, value: Any) -> bool:
        return isinstance(told, (list, tuple)) and sorted(map(str, told)) == sorted(value or ())


class Source(Field):
    """Where heads come from: a maker, or FOLDER and which."""

    @property
    def style(self) -> str:
        return "source"

    @property
    def folder(self) -> str:
        """The property of the folder."""
        return f"{self.name}_folder"

    @property
    def paths(self) -> tuple[str, ...]:
        return (self.folder,)

    def properties(self) -> dict[str, Property]:
        folder = ("Folder", HELP[f"{self.setting.name}:{FOLDER}"])
        makers = (
            (n, LABELS.get(f"{self.setting.name}:{n}", titled(n)), HELP.get(f"{self.setting.name}:{n}", ""))
            for n in registries.HEAD_MAKERS
        )
        items = (*makers, (FOLDER, *folder))
        words = {"name": folder[0], "description": folder[1]}
        return {
            self.name: Property(
                "EnumProperty", {**self.words, "items": items, "default": self.setting.default}
            ),
            self.folder: Property("StringProperty", {**words, "subtype": "DIR_PATH"}),
        }

    def value(self, get: Get) -> Any:
        found = get(self.name)
        if found == FOLDER:
            return get(self.folder)
        return f"{found}:{get(self.folder)}" if asks_for_folder(found) else found

    def properties_of(self, value: Any) -> dict[str, Any]:
        if is_made(value):
            return {self.name: value.partition(":")[0], self.folder: split_path(value)[1]}
        return {self.name: FOLDER, self.folder: value}

    def shows(self, told: Any, value: Any) -> bool:
        # What a maker is told behind the colon has no property.
        return same(told, value) or (is_made(told) and told.partition(":")[0] == value)


def asks_for_folder(choice: str) -> bool:
    """Does a choice of where heads come from need a folder?"""
    return choice == FOLDER or choice in registries.MAKERS_OF_FOLDERS


def _items(setting: Setting) -> tuple[tuple[str, str, str], ...]:
    named = [LABELS.get(f"{setting.name}:{choice.value}", titled(choice.name)) for choice in setting.choices]
    return tuple((one.value, name, one.help) for one, name in zip(setting.choices, named, strict=True))
