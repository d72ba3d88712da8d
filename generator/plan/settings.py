# SPDX-License-Identifier: GPL-3.0-or-later
"""Every setting of a build, once: what it is, what it may be, what it is called.

A section of the configuration is a class here, a setting is a field of it. Validation, TOML, the
options of the command line, Blender's properties and panel, docs/configuration.md and the names of
units follow from these classes; see docs/architecture.md. stdlib only: Blender imports it too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, dataclass, fields
from functools import cache
from typing import Any, get_type_hints

from generator import registries
from generator.limits import MAX_HEADS, MAX_POSES, MAX_SEED
from generator.plan.factors import factor_choices
from generator.plan.render_settings import Lens as Lens
from generator.plan.render_settings import Look as Look
from generator.plan.render_settings import Projection as Projection
from generator.plan.render_settings import Render as Render
from generator.plan.setting import Choice, Setting, setting

PARAMETRIC = "parametric"
"""The head source that is made on the spot."""

_AXES = tuple(Choice(sign + axis, label=sign + axis) for axis in "XYZ" for sign in "+-")


def _registered(registry: Any) -> Callable[[], tuple[Choice, ...]]:
    return lambda: tuple(Choice(name) for name in registry)


@dataclass(frozen=True)
class Heads:
    """Which heads."""

    source: str = setting(
        PARAMETRIC, 'A head source, or heads made on the spot: "parametric", from MakeHuman\'s CC0 data, or '
        '"ict:PATH", from your own copy of ICT-FaceKit',
        flag="--heads", label="Heads", path=True,
    )  # fmt: skip
    count: int = setting(3, "Heads to make on the spot", low=1, high=MAX_HEADS, label="Heads", grows=True)
    seed: int = setting(
        0, "The same seed makes the same heads, and draws the same random poses",
        low=0, high=MAX_SEED, label="Seed",
    )  # fmt: skip
    sampled_expressions: int = setting(
        0, "Sampled expressions of each head that is made, besides the neutral face",
        low=0, high=1000, label="Expressions", grows=True,
    )  # fmt: skip
    subjects: tuple[str, ...] | None = setting(
        None, "Only this subject; repeatable",
        flag="--subject", label="Subjects", grows=True,
    )  # fmt: skip
    expressions: tuple[str, ...] | None = setting(
        None, "Only this expression; repeatable",
        flag="--expression", label="Expressions", grows=True,
    )  # fmt: skip
    license: str | None = setting(None, "Licence of heads that name none", label="Licence")
    redistributable: bool | None = setting(
        None, "May renders of heads that do not say so be published?", label="Redistributable"
    )
    units: str | None = setting(
        None, "Unit of the meshes; without it the size of the face decides",
        choices=(
            Choice("um", label="Micrometres"), Choice("mm", label="Millimetres"),
            Choice("cm", label="Centimetres"), Choice("dm", label="Decimetres"), Choice("m", label="Metres"),
        ),
        label="Units",
    )  # fmt: skip
    eye_distance_mm: float | None = setting(
        None, "Distance of the outer eye corners of meshes that are in no unit; without it 90 mm",
        unit="mm", low=20, high=500, label="Eye distance",
    )  # fmt: skip
    without: tuple[str, ...] | None = setting(
        None,
        "Leave out the triangles of this material, such as lash cards; repeatable",
    )
    head_object: str | None = setting(
        None, "The object or collection of a Blender scene that is the head, with all that is parented to it"
    )
    up: str | None = setting(
        None, "Axis of the meshes' crown, such as +Y; without it the face decides",
        choices=_AXES, label="Up",
    )  # fmt: skip
    forward: str | None = setting(
        None, "Axis of the meshes' nose, such as +Z; without it the face decides",
        choices=_AXES, label="Forward",
    )  # fmt: skip


@dataclass(frozen=True)
class Poses:
    """Which poses; see generator.plan.poses. A range is start, stop and step, or low and high."""

    kind: str = setting(
        "grid", "grid, uniform:N, sobol:N, or a CSV file",
        choices=(
            Choice("grid", "Every combination of yaw, pitch and roll"),
            Choice("uniform", "Random poses, independent of each other"),
            Choice("sobol", "Random poses, evenly spread"),
            Choice("csv", "The poses of a table", label="CSV file"),
        ),
        flag="--poses", label="Poses", grows=True,
    )  # fmt: skip
    yaw: tuple[float, ...] = setting(
        (-50.0, 50.0, 10.0), "START,STOP,STEP of the grid, or LOW,HIGH of random poses",
        unit="degrees", label="Yaw", grows=True,
    )  # fmt: skip
    pitch: tuple[float, ...] = setting(
        (-40.0, 40.0, 10.0), "As --yaw",
        unit="degrees", label="Pitch", grows=True,
    )  # fmt: skip
    roll: tuple[float, ...] = setting(
        (-30.0, 30.0, 10.0), "As --yaw",
        unit="degrees", label="Roll", grows=True,
    )  # fmt: skip
    count: int = setting(
        693,
        "Random poses for each head",
        low=1,
        high=MAX_POSES,
        flag="--poses",
        label="Count",
        grows=True,
    )
    seed: int = setting(
        0, "The same seed draws the same poses", low=0, high=MAX_SEED, label="Seed", grows=True
    )
    path: str | None = setting(
        None, "CSV file with the columns yaw_deg, pitch_deg, roll_deg",
        flag="--poses", label="File", grows=True, path=True,
    )  # fmt: skip
    same: bool = setting(
        False, "Every head gets the same random poses, instead of a draw of its own",
        flag="--same-poses", label="Same poses for every head", grows=True,
    )  # fmt: skip
    frame: str = setting(
        "source", "Where pose zero is",
        choices=(
            Choice("source", "The mesh's own axes", label="As modelled"),
            Choice("level", "Where the detector reads heads of the source as level", label="Level"),
            Choice("canonical", "Levelled head by head, as in earlier releases", label="Levelled before"),
        ),
        label="Pose zero",
    )  # fmt: skip


@dataclass(frozen=True)
class Landmarks:
    """Who finds the landmarks."""

    detector: str = setting(
        "mediapipe", "The detector; further ones after commas, each with a column of its own",
        choices=_registered(registries.DETECTORS),
    )  # fmt: skip
    also: tuple[str, ...] = setting(
        (), "Further detectors, each of which gets a column landmarks_NAME", flag="--detector",
        choices=tuple(Choice(name) for name in registries.DETECTORS),
    )  # fmt: skip
    file: str | None = setting(
        None,
        "Where the networks of the detector file are: a face_landmarker.task, or mediapipe 0.10.21's wheel",
        flag="--detector-file", path=True, content=False,
    )  # fmt: skip
    min_confidence: float = setting(
        0.5, "Lowest score at which the detector reports a face", above=0, high=1,
        label="Min. confidence",
    )  # fmt: skip


@dataclass(frozen=True)
class Dataset:
    """What is written."""

    images: str = setting(
        "files", "Where the images go",
        choices=(
            Choice("files", "Image files beside the tables"),
            Choice("embedded", "Images inside the tables"),
            Choice("none", "Landmarks and poses only"),
        ),
        label="Images",
    )  # fmt: skip
    image_format: str = setting(
        "png", "Format of the images",
        choices=(Choice("png", "Exact", label="PNG"), Choice("jpg", "Smaller", label="JPEG")),
        label="Format",
    )  # fmt: skip
    passes: tuple[str, ...] = setting(
        (), "OpenEXR passes, with commas", choices=_registered(registries.PASSES), label="Passes"
    )
    validation: float = setting(
        0.0, "Share of the subjects that go to the validation split", low=0, high=1, label="Validation",
        content=False,
    )  # fmt: skip
    twins: tuple[str, ...] = setting(
        (), "Factors, with commas: each gives rows a twin, the same head and pose with that factor changed",
        choices=factor_choices(), grows=True, content=False,
    )  # fmt: skip
    twins_share: float = setting(
        1.0, "Share of the rows that get a twin of each factor", low=0, high=1, grows=True, content=False
    )
    unit_size: int = setting(
        50, "Poses that are rendered and written together", low=1, high=100_000, content=False
    )


ROWS = ("heads", "poses")
"""The sections that choose rows."""

SECTIONS: dict[str, type] = {
    "heads": Heads,
    "poses": Poses,
    "render": Render,
    "landmarks": Landmarks,
    "dataset": Dataset,
}
"""The tables of a configuration, in their order."""

Values = dict[str, dict[str, Any]]
"""section -> key -> plain value."""


def all_settings() -> Iterator[Setting]:
    """Every setting, section by section."""
    for name, section in SECTIONS.items():
        yield from section_settings(name, section)


@cache
def section_settings(name: str, section: type) -> tuple[Setting, ...]:
    """The settings of one section."""
    kinds = get_type_hints(section)
    return tuple(
        Setting(
            name,
            found.name,
            kinds[found.name],
            found.default if found.default is not MISSING else None,
            found.metadata["info"],
        )
        for found in fields(section)
    )


def known_values(values: Values) -> Values:
    """Values without those of settings that there are not."""
    return {
        name: {
            known.key: values[name][known.key]
            for known in section_settings(name, section)
            if known.key in values[name]
        }
        for name, section in SECTIONS.items()
        if isinstance(values.get(name), dict)
    }


def with_defaults(values: Values) -> Values:
    """Values of every setting: those given, else the default."""
    every: Values = {name: {} for name in SECTIONS}
    for known in all_settings():
        every[known.section][known.key] = values.get(known.section, {}).get(known.key, known.default)
    return every


def beyond_defaults(values: Values, wanted: Callable[[Setting], bool]) -> dict[str, Any]:
    """Values by "section.key" of the wanted settings that are not the default.

    So a setting that is added later changes nothing where it is not used. values: plain, as JSON has them.
    """
    found = {}
    for known in all_settings():
        value = values.get(known.section, {}).get(known.key, known.default)
        if wanted(known) and plain(value) != plain(known.default):
            found[known.name] = plain(value)
    return found


def value_text(value: Any) -> str:
    """A value for people."""
    if isinstance(value, (list, tuple)):
        return ", ".join(map(value_text, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def plain(value: Any) -> Any:
    """A value as JSON has it: lists for tuples."""
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value
