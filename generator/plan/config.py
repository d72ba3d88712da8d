# SPDX-License-Identifier: GPL-3.0-or-later
"""The build configuration: one TOML file, or the flags that say the same."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from generator.errors import UsageError
from generator.plan.poses import PosePlan, csv_plan, grid_plan, sobol_plan, uniform_plan
from generator.plan.render_settings import RenderSettings

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PARAMETRIC = "parametric"
Axis = Literal["+X", "-X", "+Y", "-Y", "+Z", "-Z"]
PRESET_SAMPLES = {"fast": 1, "quality": 4}


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Heads(_Section):
    """Which heads. ``source`` is a path, or "parametric" for heads made on the spot."""

    source: str = PARAMETRIC
    count: int = Field(3, ge=1)
    seed: int = Field(0, ge=0)
    sampled_expressions: int = Field(0, ge=0)
    subjects: list[str] | None = None
    expressions: list[str] | None = None
    license: str | None = None
    redistributable: bool | None = None
    units: Literal["um", "mm", "cm", "dm", "m"] | None = None
    up: Axis | None = None
    forward: Axis | None = None


class Poses(_Section):
    """Which poses; see generator.plan.poses. Ranges are [start, stop, step] or [low, high].

    ``frame``: where pose zero is: the mesh's own axes ("source"), or every head levelled to
    the same face ("canonical").
    """

    frame: Literal["source", "canonical"] = "source"

    kind: Literal["grid", "uniform", "sobol", "csv"] = "grid"
    yaw: list[float] = [-50, 50, 10]
    pitch: list[float] = [-40, 40, 10]
    roll: list[float] = [-30, 30, 10]
    count: int = Field(693, ge=1)
    seed: int = Field(0, ge=0)
    path: str | None = None

    def plan(self) -> PosePlan:
        """The pose plan these settings describe. UsageError if they make no sense."""
        if self.kind == "csv":
            if self.path is None:
                raise UsageError("poses.path: a CSV pose plan needs the path of its file")
            return csv_plan(Path(self.path))
        if self.kind == "grid":
            for name, axis in (("yaw", self.yaw), ("pitch", self.pitch), ("roll", self.roll)):
                if len(axis) != 3:
                    raise UsageError(f"poses.{name}: a grid needs start, stop and step, got {axis}")
            return grid_plan(tuple(self.yaw), tuple(self.pitch), tuple(self.roll))
        draw = uniform_plan if self.kind == "uniform" else sobol_plan
        ranges = {name: (getattr(self, name)[0], getattr(self, name)[1]) for name in ("yaw", "pitch", "roll")}
        return draw(self.count, self.seed, **ranges)


class Render(_Section):
    """How images are made; see generator.plan.render_settings."""

    preset: Literal["fast", "quality"] = "fast"
    samples: int | None = Field(None, ge=1, le=4096)
    resolution: int = Field(256, ge=16, le=4096)
    lens_mm: float = Field(85.0, ge=10, le=1000)
    projection: Literal["perspective", "orthographic"] = "perspective"
    distance_mm: float | None = Field(None, ge=100, le=100_000)
    margin: float = Field(1.05, ge=0.5, le=10)
    light_yaw_deg: float = Field(25.0, ge=-180, le=180)
    light_pitch_deg: float = Field(35.0, ge=-90, le=90)
    ambient: float = Field(0.35, ge=0, le=1)
    background: tuple[float, float, float] = (0.5, 0.5, 0.5)

    def settings(self) -> RenderSettings:
        """The settings the render worker understands."""
        values = self.model_dump()
        if values["samples"] is None:
            values["samples"] = PRESET_SAMPLES[self.preset]
        return RenderSettings.from_dict(values)

    @model_validator(mode="after")
    def _background_in_range(self) -> Render:
        if not all(0 <= c <= 1 for c in self.background):
            raise ValueError("background is three sRGB values between 0 and 1")
        return self


class Landmarks(_Section):
    """Which detector finds the landmarks."""

    detector: Literal["mediapipe"] = "mediapipe"
    min_confidence: float = Field(0.5, gt=0, le=1)


class Dataset(_Section):
    """What is written. ``validation``: share of the subjects that go to the validation split."""

    images: Literal["files", "embedded", "none"] = "files"
    image_format: Literal["png", "jpg"] = "png"
    passes: list[Literal["depth", "normal", "position", "uv", "object_index"]] = []
    validation: float = Field(0.0, ge=0, le=1)
    unit_size: int = Field(100, ge=1, le=100_000)


class BuildConfig(_Section):
    """Everything that decides a dataset's content, and nothing else."""

    heads: Heads = Heads()
    poses: Poses = Poses()
    render: Render = Render()
    landmarks: Landmarks = Landmarks()
    dataset: Dataset = Dataset()

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return self.model_dump(mode="json")


def load_config(path: Path | None, overrides: dict[str, dict[str, Any]]) -> BuildConfig:
    """Read a TOML file and lay the flags over it.

    Parameters
    ----------
    path: None means all defaults.
    overrides: section -> key -> value.

    Raises
    ------
    UsageError: the file is missing or not TOML, a key is unknown, a value is
        out of range.
    """
    values: dict[str, Any] = {}
    if path is not None:
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError as error:
            raise UsageError(f"{path}: there is no such configuration file") from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
            raise UsageError(f"{path}: not a TOML configuration: {error}") from error
    for section, changes in overrides.items():
        merged = values.setdefault(section, {})
        if not isinstance(merged, dict):
            raise UsageError(f"{path}: [{section}] must be a table")
        merged.update(changes)
    try:
        return BuildConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        given = "" if first["type"] in ("missing", "extra_forbidden") else f", got {first['input']!r}"
        raise UsageError(f"{path or 'configuration'}: {where}: {first['msg']}{given}") from error


def config_toml(config: BuildConfig) -> str:
    """The resolved configuration as TOML; None values are left out, as TOML has none."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def differences(ours: BuildConfig, theirs: BuildConfig) -> list[str]:
    """One ``section.key: theirs -> ours`` a setting that differs."""
    a, b = theirs.as_dict(), ours.as_dict()
    return [
        f"{section}.{key}: {a[section][key]!r} -> {b[section][key]!r}"
        for section in a
        for key in a[section]
        if a[section][key] != b[section][key]
    ]
