# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from generator.errors import UsageError
from generator.plan import poses
from generator.plan.pose_plans import PosePlans, poses_csv
from generator.plan.poses import PosePlan, csv_plan, grid_plan, pose_name, sobol_plan, uniform_plan


def test_default_grid_is_the_reference_grid():
    plan = grid_plan()
    assert len(plan) == 693 and plan.kind == "grid"
    assert plan.angles_deg.dtype == np.float64 and plan.indices.dtype == np.int16
    assert plan.angles_deg[0].tolist() == [-50, -40, -30] and plan.angles_deg[-1].tolist() == [50, 40, 30]
    assert plan.indices[-1].tolist() == [10, 8, 6]
    poses = [tuple(pose) for pose in plan.angles_deg.tolist()]
    assert poses == sorted(set(poses))
    np.testing.assert_array_equal(plan.angles_deg, plan.indices * 10 - [50, 40, 30])


def test_grid_values_are_the_decimal_literals():
    plan = grid_plan((0, 0.5, 0.1), (-0.3, 0.3, 0.3), (7, 7, 1))
    assert sorted(set(plan.angles_deg[:, 0].tolist())) == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert sorted(set(plan.angles_deg[:, 1].tolist())) == [-0.3, 0.0, 0.3]
    assert set(plan.angles_deg[:, 2].tolist()) == {7.0}
    assert not np.signbit(plan.angles_deg[plan.angles_deg == 0]).any()


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"yaw": (-50, 50, 7)}, "yaw: a step of 7 does not divide .* use a step of 5 or 10, or stop at 48"),
        ({"pitch": (0, 1, 0.3)}, "use a step of 0.2 or 0.5, or stop at 0.9"),
        ({"roll": (0, 10, 4)}, "use a step of 2.5 or 5, or stop at 8"),
        ({"roll": (0, 5, 10)}, "roll: a step of 10 does not divide"),
        ({"yaw": (0, 10)}, r"poses.yaw: a grid needs start, stop and step, got \[0, 10\]"),
        ({"yaw": (0, 10, 0)}, "the step is 0"),
        ({"yaw": (0, 10, -5)}, "the step is -5"),
        ({"yaw": (0, 10, float("nan"))}, "the step is nan"),
        ({"yaw": (10, 0, 5)}, "above its end"),
        ({"yaw": (-90, 0, 10)}, "gimbal lock"),
        ({"yaw": (0, float("nan"), 10)}, "yaw is nan"),
        ({"pitch": (-180, 180, 90)}, "-180 is 180"),
        ({"roll": (0, 190, 10)}, "roll is 190"),
        ({"roll": (0.5, 180.5, 10)}, "roll is 180.5"),
        ({"roll": (0, 1, 1.5)}, "use a step of 0.5 or 1, or"),
        ({"roll": (0, 0.3, 0.2)}, "use a step of 0.1 or 0.3, or"),
        ({"yaw": (0, 80, 0.0001)}, "larger step"),
        ({"yaw": (-50, 50, 0.1), "pitch": (-50, 50, 0.1)}, "7,014,007 poses"),
    ],
)
def test_grid_refuses(axes, message):
    with pytest.raises(UsageError, match=message) as error:
        grid_plan(**axes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("draw", [uniform_plan, sobol_plan])
def test_random_plans(draw):
    plan = draw(501, 7, (-50, 50), (-10, 40), (5, 5))
    assert len(plan) == 501 == len(np.unique(plan.angles_deg, axis=0))
    assert (plan.indices == -1).all()
    assert (plan.angles_deg >= [-50, -10, 5]).all() and (plan.angles_deg <= [50, 40, 5]).all()
    np.testing.assert_array_equal(plan.angles_deg, np.round(plan.angles_deg, 4))
    assert (plan.angles_deg != np.round(plan.angles_deg, 3)).any(), "and all four decimals are used"
    assert plan.angles_deg.tolist() == sorted(plan.angles_deg.tolist())
    assert abs(plan.angles_deg[:, 0].mean()) < 5 and 10 < plan.angles_deg[:, 1].mean() < 20
    np.testing.assert_array_equal(plan.angles_deg, draw(501, 7, (-50, 50), (-10, 40), (5, 5)).angles_deg)
    assert (plan.angles_deg != draw(501, 8, (-50, 50), (-10, 40), (5, 5)).angles_deg).any()


@pytest.mark.parametrize("draw", [uniform_plan, sobol_plan])
def test_a_draw_without_ranges_is_over_those_of_the_default_grid(draw):
    drawn, grid = draw(4000, 1).angles_deg, grid_plan().angles_deg
    np.testing.assert_allclose([drawn.min(axis=0), drawn.max(axis=0)], [grid[0], grid[-1]], atol=0.3)


@pytest.mark.parametrize("draw", [uniform_plan, sobol_plan])
def test_random_plans_refuse(draw):
    with pytest.raises(UsageError, match="expected at least 1"):
        draw(0, 1)
    with pytest.raises(UsageError, match="too narrow"):
        draw(2, 1, (0, 0), (0, 0), (0, 0))
    with pytest.raises(UsageError, match="gimbal"):
        draw(2, 1, (0, 95))
    assert draw(1, 1, (5, 5), (-6, -6), (7, 7)).angles_deg.tolist() == [[5, -6, 7]]
    assert len(draw(3, 1, (0, 0), (0, 0), (0, 0.001))) == 3  # collisions are drawn again
    assert len(draw(5, 1, (0, 0), (0, 0), (0, 0.001))) == 5  # half of what there is
    with pytest.raises(UsageError, match="too narrow"):
        draw(6, 1, (0, 0), (0, 0), (0, 0.001))
    with pytest.raises(UsageError, match=r"poses\.roll: a \w+ plan takes low and high, got \[0, 1, 1\]"):
        draw(2, 1, roll=(0, 1, 1))


def written(count: int, folder: Path) -> PosePlan:
    """A table of so many poses."""
    (folder / "p.csv").write_text("yaw,pitch,roll\n" + "".join(f"{k},0,0\n" for k in range(count)))
    return csv_plan(folder / "p.csv")


@pytest.mark.parametrize(
    "plan",
    [
        lambda count, _: grid_plan((1, count, 1), (0, 0, 1), (0, 0, 1)),
        lambda count, _: uniform_plan(count, 0),
        lambda count, _: sobol_plan(count, 0),
        written,
    ],
    ids=["grid", "uniform", "sobol", "csv"],
)
def test_as_many_poses_as_are_allowed_and_not_one_more(
    plan: Callable[[int, Path], PosePlan], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(poses, "MAX_POSES", 6)
    assert len(plan(6, tmp_path)) == 6
    with pytest.raises(UsageError, match="more than 6"):
        plan(7, tmp_path)


def test_an_axis_has_as_many_values_as_an_index_counts():
    plan = grid_plan((0, 0, 1), (0, 0, 1), (-163.83, 163.84, 0.01))
    assert plan.indices[-1].tolist() == [0, 0, len(plan) - 1] == [0, 0, 2**15 - 1]
    with pytest.raises(UsageError, match="more than 32768 values"):
        grid_plan((0, 0, 1), (0, 0, 1), (-163.84, 163.84, 0.01))


def test_the_ends_of_what_an_angle_may_be():
    assert len(grid_plan((-89, 89, 89), (-179, 180, 359), (-179, 180, 359))) == 12
    for axis in ({"yaw": (-90, 0, 90)}, {"yaw": (0, 90, 90)}, {"roll": (-180, 0, 90)}):
        with pytest.raises(UsageError, match="expected"):
            grid_plan(**axis)


@pytest.mark.parametrize("plan", [grid_plan(), uniform_plan(200, 3)], ids=["grid", "uniform"])
def test_csv_round_trip_is_exact(tmp_path, plan):
    (tmp_path / "poses.csv").write_text(poses_csv(PosePlans(plan)))
    again = csv_plan(tmp_path / "poses.csv")
    assert again.angles_deg.tobytes() == plan.angles_deg.tobytes()
    assert again.indices.tobytes() == plan.indices.tobytes()


def test_csv_keeps_the_last_digit(tmp_path):
    (tmp_path / "a.csv").write_text("yaw,pitch,roll\n0.30000000000000004,33.333333333333336,1e-300\n")
    plan = csv_plan(tmp_path / "a.csv")
    assert plan.angles_deg.tolist() == [[0.1 + 0.2, 100 / 3, 1e-300]]
    (tmp_path / "b.csv").write_text(poses_csv(PosePlans(plan)))
    assert csv_plan(tmp_path / "b.csv").angles_deg.tobytes() == plan.angles_deg.tobytes()


def test_csv_of_a_user(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("\ufeffid,roll,yaw,pitch\na,0.1,30,-0\n\nb,2e1,-30.25,7\n", encoding="utf-8")
    plan = csv_plan(path)
    assert plan.angles_deg.tolist() == [[-30.25, 7.0, 20.0], [30.0, 0.0, 0.1]]
    assert (plan.indices == -1).all() and plan.kind == "csv"


HEADER = b"yaw_deg,pitch_deg,roll_deg\n"
INDEXED = HEADER[:-1] + b",yaw_index,pitch_index,roll_index\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (HEADER, "no poses below the header"),
        (b"yaw,pitch\n1,2\n", "expected a header with the columns yaw_deg,pitch_deg,roll_deg"),
        (b"yaw;pitch;roll\n1;2;3\n", "separated by commas"),
        (b"1,2,3\n", "expected a header"),
        (HEADER + b"1,2,3\n4,5,6\n1.0,2,3\n", "line 4: the pose of line 2 again"),
        (HEADER + b"0,2,-0.0\n-0,2,0\n", "line 3: the pose of line 2 again"),
        (HEADER + b"1,2,3\n1,two,3\n", "line 3: pitch_deg is 'two'"),
        (HEADER + b"1,nan,3\n", "line 2: pitch_deg is 'nan'"),
        (HEADER + b"1,2\n", "line 2: roll_deg is ''"),
        (HEADER + b"1,2,inf\n", "line 2: roll_deg is 'inf'"),
        (HEADER + b"1,2,3,4\n", "line 2: 4 cells, the header has 3"),
        (HEADER + b"90,2,3\n", "line 2: yaw is 90.*gimbal"),
        (INDEXED + b"1,2,3,0,x,0\n", "pitch_index is 'x'"),
        (INDEXED + b"1,2,3,-2,0,0\n", "yaw_index is '-2'"),
        (INDEXED + b"1,2,3,0,0,32768\n", "roll_index is '32768'"),
        (b"\xff\xfe\x00", "cannot be read as a CSV"),
    ],
)
def test_csv_refuses(tmp_path, content, message):
    path = tmp_path / "p.csv"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=message) as error:
        csv_plan(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_csv_takes_every_place_that_an_index_counts(tmp_path):
    (tmp_path / "p.csv").write_bytes(INDEXED + b"1,2,3,-1,0,32767\n")
    assert csv_plan(tmp_path / "p.csv").indices.tolist() == [[-1, 0, 2**15 - 1]]


def test_csv_missing(tmp_path):
    with pytest.raises(UsageError, match=r"nothing\.csv"):
        csv_plan(tmp_path / "nothing.csv")


def test_pose_name_is_exact_and_safe():
    assert pose_name(10, -20, 0) == "y+10_p-20_r+0"
    assert pose_name(np.float64(12.3456), -0.0, 1e-7) == "y+12.3456_p+0_r+1e-07"
    angles = uniform_plan(2000, 1).angles_deg.tolist()
    assert len({pose_name(*pose) for pose in angles}) == len(angles)
