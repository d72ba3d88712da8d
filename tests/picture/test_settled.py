# SPDX-License-Identifier: GPL-3.0-or-later
"""Environments, backdrops and pictures by their names: what a build may be told, and what it says if not."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from panoramas import even, from_the_right, write_exr

from generator.cli.options import values_of
from generator.errors import UsageError
from generator.picture.files import read_panorama, read_picture
from generator.picture.settled import check_files, settled
from generator.plan.config import BuildConfig, config_toml, load_config, read_recorded
from generator.plan.settings import all_settings
from generator.plan.view_plan import plan_views

POSES = [(float(yaw), 0.0, 0.0) for yaw in range(-60, 61)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three panoramas."""
    made = tmp_path / "panoramas"
    made.mkdir()
    for name in ("beach", "alley", "cave"):
        write_exr(made / f"{name}.exr", from_the_right())
    return made


def config(folder: Path, **render: Any) -> BuildConfig:
    return load_config(None, {"render": {"environments": str(folder), **render}})


def looks(config: BuildConfig, head: str = "amy/neutral") -> list[Any]:
    return [view.look for view in plan_views(config, head, 120.0, POSES)]


@pytest.mark.parametrize("text", ["all", "choice:all"])
def test_all_is_every_one_by_its_name(folder: Path, text: str) -> None:
    found = settled(config(folder, environment=text))
    assert found.drawn["render.environment"].texts == ("alley", "beach", "cave")
    assert len(found.render.files_sha256) == 64
    drawn = Counter(look.environment for look in looks(found))
    assert set(drawn) == {"alley", "beach", "cave"} and min(drawn.values()) > 20


def test_a_choice_may_be_a_head_s_and_say_some_twice(folder: Path) -> None:
    found = settled(config(folder, environment="head:choice:none,cave,cave"))
    assert len({look.environment for look in looks(found)}) == 1
    heads = [looks(found, f"h{k}/neutral")[0].environment for k in range(60)]
    assert Counter(heads)["cave"] > Counter(heads)["none"] > 0


def test_settled_is_settled_and_recorded(folder: Path, tmp_path: Path) -> None:
    found = settled(config(folder, environment="all", backdrop="choice:plain,environment"))
    assert settled(found) == found
    (tmp_path / "config.toml").write_text(config_toml(found.moved_to(tmp_path)))
    again = read_recorded(tmp_path / "config.toml")
    assert again.drawn == found.drawn and looks(again) == looks(found)
    check_files(again)
    write_exr(folder / "cave.exr", even())
    with pytest.raises(UsageError, match="its panoramas or pictures are others than then"):
        check_files(again)


def test_other_bytes_are_another_configuration_and_other_files_are_not(folder: Path) -> None:
    before = settled(config(folder, environment="cave")).render.files_sha256
    write_exr(folder / "alley.exr", even())
    assert settled(config(folder, environment="cave")).render.files_sha256 == before
    write_exr(folder / "cave.exr", even())
    assert settled(config(folder, environment="cave")).render.files_sha256 != before


def test_without_an_environment_nothing_is_read(tmp_path: Path) -> None:
    plain = config(tmp_path / "nowhere")
    assert settled(plain) == plain and plain.render.files_sha256 == ""


def test_a_draw_of_texts_depends_on_nothing_else(folder: Path) -> None:
    one = settled(config(folder, environment="all"))
    both = settled(config(folder, environment="all", ambient="uniform:0,1", backdrop="choice:noise,plain"))
    assert [look.environment for look in looks(one)] == [look.environment for look in looks(both)]
    last = plan_views(both, "amy/neutral", 120.0, POSES[-1:])[0]
    assert (
        last.look == looks(both)[-1] and last.seed == plan_views(both, "amy/neutral", 120.0, POSES)[-1].seed
    )
    reseeded = replace(both, poses=replace(both.poses, seed=1))
    assert [look.environment for look in looks(reseeded)] != [look.environment for look in looks(both)]


def test_pictures_are_drawn_by_their_names(folder: Path, tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for name in ("a.png", "b.jpg"):
        cv2.imwrite(str(pictures / name), np.zeros((4, 6, 3), np.uint8))
    found = settled(config(folder, backdrop="picture", pictures=str(pictures)))
    assert {look.backdrop_picture for look in looks(found)} == {"a.png", "b.jpg"}
    one = settled(config(folder, backdrop="picture", pictures=str(pictures), backdrop_picture="b.jpg"))
    assert not one.drawn and one.render.files_sha256 != found.render.files_sha256


def test_options_take_texts_and_choices() -> None:
    flags: dict[str, list[Any]] = {}
    for known in all_settings():
        flags.setdefault(known.flag, []).append(known)
    for text in ("city", "all", "head:choice:city,forest"):
        assert values_of({"--environment": text}, flags) == {"render": {"environment": text}}


@pytest.mark.parametrize(
    ("render", "said"),
    [
        ({"environment": "cavern"}, r"render\.environment: no 'cavern'; there are cave"),
        ({"environment": "choice:cave,x"}, r"render\.environment: no 'x'; there are alley, beach, cave"),
        ({"environment": "choice:cave,"}, r"render\.environment: expected texts separated by commas"),
        ({"backdrop": "wall"}, r"no backdrop 'wall'; there are plain, environment, noise, picture"),
        ({"backdrop": "environment"}, r"there is none; give --environment"),
        ({"backdrop": "picture"}, r"no folder of pictures is given; name one in --pictures"),
        ({"environment": "cave", "environments": "nowhere"}, r"nowhere: No such file or directory; give a"),
        ({"environment_strength": "uniform:2,1"}, r"the low end 2 is above the high end 1"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(folder: Path, render: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said) as error:
        settled(config(folder, **render))
    assert "\n" not in str(error.value)


def test_a_folder_without_any_and_names_that_cannot_be_chosen(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no \.exr or \.hdr is in it"):
        settled(config(tmp_path, environment="all"))
    write_exr(tmp_path / "a,b.exr", even())
    with pytest.raises(UsageError, match="rename it without commas and colons"):
        settled(config(tmp_path, environment="all"))
    (tmp_path / "a,b.exr").rename(tmp_path / "a.exr")
    (tmp_path / "a.hdr").write_bytes(b"")
    with pytest.raises(UsageError, match=r"a\.exr has the same name; rename one"):
        settled(config(tmp_path, environment="all"))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "is empty; expected an image"),
        (b"no image", r"not a readable panorama \(no OpenEXR\)"),
        (b"\x76\x2f\x31\x01\x02\0\0\0", r"not a readable panorama \(its header is cut off\)"),
    ],
)
def test_a_panorama_that_is_none(tmp_path: Path, data: bytes, said: str) -> None:
    (tmp_path / "sky.exr").write_bytes(data)
    with pytest.raises(UsageError, match=said):
        read_panorama(tmp_path / "sky.exr")


def test_a_panorama_that_is_cut_off_black_or_no_panorama(tmp_path: Path) -> None:
    path = write_exr(tmp_path / "sky.exr", np.random.default_rng(0).random((32, 64, 3)).astype(np.float32))
    path.write_bytes(path.read_bytes()[:-4000])
    with pytest.raises(UsageError, match="not a readable panorama"):
        read_panorama(path)
    with pytest.raises(UsageError, match="is black and gives no light"):
        read_panorama(write_exr(path, even(0)))
    with pytest.raises(UsageError, match="32 x 32 pixels, expected twice as wide as high"):
        read_panorama(write_exr(path, even()[:, :32]))
    os.mkfifo(tmp_path / "pipe.exr")
    with pytest.raises(UsageError, match="not a regular file"):
        read_panorama(tmp_path / "pipe.exr")


def test_radiance_pictures_are_read_and_large_ones_are_averaged(tmp_path: Path) -> None:
    light = np.repeat(np.repeat(from_the_right(), 64, axis=0), 64, axis=1)
    cv2.imwrite(str(tmp_path / "sky.hdr"), light)
    found = read_panorama(tmp_path / "sky.hdr")
    assert found.shape == (512, 1024, 3) and abs(found.mean() / light.mean() - 1) < 0.01
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\n\n-Y 99999 +X 199998\n" + bytes(100))
    with pytest.raises(UsageError, match="more than 33,554,432 pixels"):
        read_panorama(tmp_path / "sky.hdr")
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\n\n-Y 32 +X 64\n" + bytes(10))
    with pytest.raises(UsageError, match="not a readable panorama"):
        read_panorama(tmp_path / "sky.hdr")


def test_a_picture_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"no image")
    with pytest.raises(UsageError, match="not a readable picture"):
        read_picture(tmp_path / "a.png")
