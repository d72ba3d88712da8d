# SPDX-License-Identifier: GPL-3.0-or-later
"""Units are named by what decides their content, and by nothing else."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from dry_build import DryBuild
from no_renderer import NoRenderer

from generator.content import content_versions
from generator.errors import DatasetError
from generator.execution.build import units
from generator.execution.build.folder import CONFIG_FILE
from generator.plan.setting import setting
from generator.plan.settings import SECTIONS, Look
from generator.plan.views import Views


def built_anew(dry: DryBuild, **sections: dict[str, Any]) -> list[str]:
    """Part names of the same heads in another folder."""
    other = DryBuild(dry.root.parent / "other", "amy", "bob")
    other.build(**sections)
    return other.parts


def with_one_more(section: str, kind: type, default: Any, **info: Any) -> type:
    """A section with one more setting at its end."""
    field = setting(default, "One that a later release brings", **info)
    return dataclasses.make_dataclass(
        "Later", [("later", kind, field)], bases=(SECTIONS[section],), frozen=True
    )


def test_the_release_changes_no_name(dry: DryBuild, monkeypatch: pytest.MonkeyPatch) -> None:
    dry.build()
    for module in ("generator", "generator.content", "generator.execution.build.run"):
        monkeypatch.setattr(f"{module}.__version__", "99.0.0")
    assert content_versions(blender="", detector="")["headturn"] == "99.0.0"
    dry.build()
    assert not dry.lanes.built and not dry.lanes.placed
    assert built_anew(dry) == dry.parts


def test_the_content_version_changes_every_name(dry: DryBuild, monkeypatch: pytest.MonkeyPatch) -> None:
    dry.build()
    parts = dry.parts
    monkeypatch.setattr("generator.content.CONTENT_VERSION", 99)
    with pytest.raises(DatasetError, match=r"4 parts .* will be deleted"):
        dry.build()
    dry.build(confirm=lambda what: True)
    assert len(dry.rendered) == 12 and not set(parts) & set(dry.parts)
    assert not dry.lanes.placed, "heads were placed anew in the build that was refused"
    dry.check()


@pytest.mark.parametrize(
    "library", ["blender", "detector", "numpy", "opencv", "embreex", "trimesh", "OpenEXR"]
)
def test_a_library_that_decides_content_changes_every_name(dry: DryBuild, library: str) -> None:
    dry.build()
    versions = content_versions(blender="none", detector="none")
    assert library in versions
    other = NoRenderer({**versions, library: "0.0.1"})
    with pytest.raises(DatasetError, match=r"4 parts .* will be deleted"):
        dry.build(lanes=other)
    assert len(other.placed) == 2, "and every head is looked at again"


OTHERWISE: dict[str, dict[str, Any]] = {
    "camera": {"render": {"lens_mm": 50}},
    "look": {"render": {"ambient": 0.1}},
    "detector": {"landmarks": {"min_confidence": 0.9}},
    "images": {"dataset": {"images": "embedded"}},
    "frame": {"poses": {"frame": "canonical"}},
    "licence": {"heads": {"license": "CC0-1.0"}},
}


@pytest.mark.parametrize("sections", OTHERWISE.values(), ids=OTHERWISE)
def test_what_decides_pixels_or_labels_is_in_the_name(dry: DryBuild, sections: dict) -> None:
    dry.build()
    assert not set(dry.parts) & set(built_anew(dry, **sections))


def test_a_view_that_differs_from_the_settings_is_in_the_name(
    dry: DryBuild, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each image may have a camera and a look of its own."""
    dry.build()
    usual = units.plan_views

    def plan_views(*given: Any) -> Views:
        views = usual(*given)
        return dataclasses.replace(views, looks=tuple(Look(ambient=0.1 + k / 10) for k in range(len(views))))

    monkeypatch.setattr(units, "plan_views", plan_views)
    assert not set(dry.parts) & set(built_anew(dry))


def test_so_is_what_is_left_out_of_a_head(dry: DryBuild) -> None:
    dry.build()
    assert not set(dry.parts) & set(built_anew(dry, heads={"without": ["lashes"]}))


def test_what_does_not_is_not(dry: DryBuild) -> None:
    """A unit size that cuts the six poses the same way, a seed that draws nothing."""
    dry.build(poses={"roll": [0, 0, 1]}, dataset={"unit_size": 3})
    assert built_anew(dry, poses={"roll": [0, 0, 1], "seed": 5}, dataset={"unit_size": 50}) == dry.parts


@pytest.mark.parametrize("section", SECTIONS)
def test_a_later_setting_changes_nothing_until_it_is_used(
    dry: DryBuild, monkeypatch: pytest.MonkeyPatch, section: str
) -> None:
    dry.build()
    monkeypatch.setitem(SECTIONS, section, with_one_more(section, float, 1.0))
    dry.build()
    assert not dry.lanes.built, "units have the names they had"
    # The orders that place heads hold the landmarks themselves, of whose default ours is no instance.
    assert section == "landmarks" or not dry.lanes.placed
    assert "later = 1.0" in (dry.root / CONFIG_FILE).read_text()
    dry.check()
    assert built_anew(dry) == dry.parts
    with pytest.raises(DatasetError, match=rf"another configuration \({section}.later: 1.0 -> 2.0\)"):
        dry.build(**{section: {"later": 2.0}})


@pytest.mark.parametrize(("content", "other"), [(True, True), (False, False)])
def test_a_later_setting_that_is_used_counts_where_it_decides_content(
    dry: DryBuild, monkeypatch: pytest.MonkeyPatch, content: bool, other: bool
) -> None:
    dry.build()
    monkeypatch.setitem(SECTIONS, "dataset", with_one_more("dataset", int, 0, content=content))
    names = built_anew(dry, dataset={"later": 7})
    assert (not set(dry.parts) & set(names)) == other


def test_names_know_nothing_of_folders(dry: DryBuild, tmp_path: Path) -> None:
    dry.build()
    heads = dry.heads.rename(tmp_path / "moved")
    other = DryBuild(tmp_path / "else", "zoe")
    other.heads = heads
    other.build()
    assert other.parts == dry.parts
