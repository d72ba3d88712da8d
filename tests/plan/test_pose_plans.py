# SPDX-License-Identifier: GPL-3.0-or-later
"""poses.csv: what was planned is read back bit by bit, whoever's poses they are."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generator.errors import DatasetError, UsageError
from generator.plan import pose_plans
from generator.plan.config import BuildConfig, load_config
from generator.plan.pose_plans import (
    PosePlans,
    is_drawn,
    plan_poses,
    poses_csv,
    read_pose_plans,
    shared_plan,
)
from generator.plan.poses import PosePlan, plan_of
from generator.plan.settings import Poses

POSE = st.tuples(
    st.floats(-90, 90, exclude_min=True, exclude_max=True), *[st.floats(-180, 180, exclude_min=True)] * 2
)
PLACE = st.tuples(*[st.integers(-1, 2**15 - 1)] * 3)
NAME = st.from_regex(r"[A-Za-z0-9_é][A-Za-z0-9_ .+-]{0,8}[A-Za-z0-9_+-]", fullmatch=True)
HEADS = st.lists(st.tuples(NAME, NAME), min_size=1, max_size=4, unique=True)


@st.composite
def some_plan(draw: st.DrawFn) -> PosePlan:
    """Poses anywhere, with any place in a grid."""
    poses = draw(st.lists(POSE, min_size=1, max_size=6, unique=True))
    places = draw(st.lists(PLACE, min_size=len(poses), max_size=len(poses)))
    return plan_of(np.array(poses), np.array(places))[0]


@st.composite
def some_plans(draw: st.DrawFn) -> PosePlans:
    """Of all heads or of each, with chunks or without."""
    heads = draw(st.just([None]) | HEADS)
    plans = {head: draw(some_plan()) for head in heads}
    chunks = {}
    if draw(st.booleans()):
        numbers = {
            head: st.lists(st.integers(0, 99), min_size=len(p), max_size=len(p)) for head, p in plans.items()
        }
        chunks = {head: np.array(draw(of), dtype=np.int64) for head, of in numbers.items()}
    if None in plans:
        return PosePlans(plans[None], {}, chunks)
    return PosePlans(None, plans, chunks)


def read(text: str) -> PosePlans:
    """As from a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "poses.csv"
        file.write_text(text, encoding="utf-8")
        return read_pose_plans(file)


def same(a: PosePlan | None, b: PosePlan | None) -> bool:
    """Bit by bit."""
    if a is None or b is None:
        return a is b
    return a.angles_deg.tobytes() == b.angles_deg.tobytes() and a.indices.tobytes() == b.indices.tobytes()


@given(some_plans())
def test_plans_are_read_back_bit_by_bit(plans: PosePlans) -> None:
    text = poses_csv(plans)
    again = read(text)
    assert same(again.shared, plans.shared)
    assert again.by_head.keys() == plans.by_head.keys()
    assert all(same(again.by_head[head], plan) for head, plan in plans.by_head.items())
    assert again.chunks.keys() == plans.chunks.keys()
    assert all(np.array_equal(again.chunks[head], numbers) for head, numbers in plans.chunks.items())
    assert poses_csv(again) == text


@given(some_plans(), st.randoms(use_true_random=False))
def test_the_order_of_lines_does_not_matter(plans: PosePlans, random: object) -> None:
    text = poses_csv(plans)
    header, *lines = text.splitlines()
    random.shuffle(lines)  # type: ignore[attr-defined]
    assert poses_csv(read("\n".join([header, *lines]) + "\n")) == text


@given(some_plans())
def test_poses_of_a_head(plans: PosePlans) -> None:
    heads = list(plans.by_head) or [("amy", "neutral")]
    for head in heads:
        assert same(plans.of(*head), plans.shared or plans.by_head[head])
    assert plans.count(heads) == sum(len(plans.of(*head)) for head in heads)
    assert len(plans.plans) == (1 if plans.shared else len(plans.by_head))
    if plans.shared is None:
        with pytest.raises(KeyError):
            plans.of("nobody", "neutral")


HEADER = "yaw_deg,pitch_deg,roll_deg,yaw_index,pitch_index,roll_index"
LINE = "1.0,2.0,3.0,-1,-1,-1"


@pytest.mark.parametrize(
    "text",
    [
        *("", HEADER, f"{HEADER}\n", "yaw_deg,pitch_deg,roll_deg\n1,2,3\n", f"{HEADER}\n1.0,2.0\n"),
        f"{HEADER}\n{LINE}\n{LINE}\n",
        f"{HEADER}\n{LINE.replace('2.0', 'nan')}\n",
        f"{HEADER}\n{LINE.replace('2.0', 'two')}\n",
        f"{HEADER}\n{LINE.replace('-1,-1,-1', '0,x,0')}\n",
        f"{HEADER},chunk\n{LINE}\n",
        f"{HEADER},chunk\n{LINE},one\n",
        f"subject,{HEADER}\namy,{LINE}\n",
        f"{HEADER}\n{'1' * 200_000}\n",
        "\0",
    ],
    ids=lambda text: repr(text[:90]),
)
def test_what_is_no_such_file_is_one_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text(text)
    with pytest.raises(DatasetError, match="not the poses of an earlier build") as error:
        read_pose_plans(file)
    assert str(file) in str(error.value) and "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"nothing\.csv"):
        read_pose_plans(tmp_path / "nothing.csv")


HEAD_NAMES = [("amy", "neutral"), ("amy", "smile"), ("bob", "neutral")]


@pytest.mark.parametrize("kind", ["uniform", "sobol"])
def test_each_head_draws_for_itself(kind: str) -> None:
    config = load_config(None, {"poses": {"kind": kind, "count": 20}})
    assert is_drawn(config.poses)
    plans = plan_poses(config, HEAD_NAMES)
    assert plans.shared is None and list(plans.by_head) == HEAD_NAMES
    poses = [set(map(tuple, plans.of(*head).angles_deg.tolist())) for head in HEAD_NAMES]
    assert not poses[0] & poses[1] and not poses[0] & poses[2], "subject and expression both count"
    other = plan_poses(config, [("zoe", "neutral"), *HEAD_NAMES[::-1]])
    assert all(same(other.of(*head), plans.of(*head)) for head in HEAD_NAMES), "order and company do not"


def test_a_draw_begins_as_a_smaller_one() -> None:
    few, many = (
        plan_poses(load_config(None, {"poses": {"kind": "sobol", "count": count}}), HEAD_NAMES)
        for count in (9, 40)
    )
    for head in HEAD_NAMES:
        assert set(map(tuple, few.of(*head).angles_deg.tolist())) < set(
            map(tuple, many.of(*head).angles_deg.tolist())
        )


@pytest.mark.parametrize("poses", [{"kind": "sobol", "same": True, "count": 9}, {"kind": "grid"}])
def test_one_plan_for_all(poses: dict) -> None:
    config = load_config(None, {"poses": poses})
    plans = plan_poses(config, HEAD_NAMES)
    assert not plans.by_head and same(plans.shared, shared_plan(config))
    assert plans.of("amy", "neutral") is plans.of("bob", "neutral")


@pytest.mark.parametrize(
    "poses",
    [{"kind": "sobol", "count": 3}, {"yaw": [-50, 50, 50], "pitch": [0, 0, 1], "roll": [0, 0, 1]}],
)
def test_as_many_rows_as_are_allowed_and_not_one_more(poses: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    config = load_config(None, {"poses": poses})
    monkeypatch.setattr(pose_plans, "MAX_ROWS", 9)
    assert plan_poses(config, HEAD_NAMES).count(HEAD_NAMES) == 9
    with pytest.raises(UsageError, match="12 rows, more than 9; use fewer heads or poses"):
        plan_poses(config, [*HEAD_NAMES, ("zoe", "neutral")])


def test_a_draw_takes_no_step() -> None:
    config = load_config(None, {"poses": {"kind": "sobol", "yaw": [0, 10, 5]}})
    with pytest.raises(UsageError, match=r"poses\.yaw: a sobol plan takes low and high"):
        plan_poses(config, HEAD_NAMES)


def test_a_table_of_poses_needs_its_path() -> None:
    with pytest.raises(UsageError, match=r"poses\.path: a CSV pose plan needs the path of its file"):
        shared_plan(BuildConfig(poses=Poses(kind="csv")))
