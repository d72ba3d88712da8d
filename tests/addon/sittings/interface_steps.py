# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in interfaces of other languages and sizes. To be imported before ui_driver, as ui_steps is."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

import bpy
import numpy as np

from ui_steps import axis_pixels, keys, shown, state  # isort: skip
from ui_driver import EXTENSION, Step, scroll, shot

registration, found = import_module(f"{EXTENSION}.registration"), import_module(f"{EXTENSION}.core.found")
studio, overlay = import_module(f"{EXTENSION}.studio"), import_module(f"{EXTENSION}.overlay")
GERMAN = bpy.app.translations


def in_german() -> Iterator[Step]:
    """No half of the panel is in German."""
    view = bpy.context.preferences.view
    view.language = "de_DE"
    view.use_translate_interface = view.use_translate_tooltips = True
    view.use_translate_reports = view.use_translate_new_dataname = False
    yield 0.5
    assert GERMAN.pgettext_iface("Seed") != "Seed", "there is German to be had"
    for prop in shown().bl_rna.properties:
        if prop.identifier in ("name", "rna_type"):
            continue
        said = [prop.name, *(item.name for item in getattr(prop, "enum_items_static", ()))]
        assert prop.translation_context == registration.WORDS, prop.identifier
        for word in said:
            assert GERMAN.pgettext_iface(word, prop.translation_context) == word, word
    for cls in registration._registered:
        if issubclass(cls, (bpy.types.Panel, bpy.types.Operator, bpy.types.Menu)):
            assert cls.bl_rna.translation_context == registration.WORDS, cls
    shown().poses_kind = "uniform"
    yield 0.3
    shot("45-german")
    yield from scroll(30)
    shot("46-german")
    yield from scroll(-60)
    shown().poses_kind = "grid"
    view.language = "en_US"
    yield 0.3


def at_twice_the_scale() -> Iterator[Step]:
    """Lines and dots grow with the interface."""
    studio.set_pose(shown(), (20, 5, 0))
    shown().show_rings = False
    points = [[60.0 + 5 * k, 150.0 + 5 * k] for k in range(10)]
    state.landmarks.take(keys.at_pose(shown()), found.Points(points))
    shown().show_landmarks = True
    yield 0.3
    assert (bpy.app.version >= (4, 5, 0)) == (overlay.POINTS == "POINT_UNIFORM_COLOR")
    before = shot("47-once")
    lines, points = axis_pixels(before), dot_pixels(before)
    bpy.context.preferences.view.ui_scale = 2.0
    yield 0.5
    bpy.ops.headturn.look()
    yield 0.3
    after = shot("48-twice")
    print("lines", lines, axis_pixels(after), "dots", points, dot_pixels(after))
    bpy.context.preferences.view.ui_scale = 1.0
    yield 0.3
    assert axis_pixels(after) > 1.4 * lines > 0 and dot_pixels(after) > 2.5 * points > 0


def dot_pixels(image: np.ndarray) -> int:
    """How many pixels have the colour of the landmarks."""
    dots = np.array(overlay.DOTS[:3])
    return int((np.abs(image - dots).max(axis=2) < 0.06).sum())
