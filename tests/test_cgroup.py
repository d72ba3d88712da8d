# SPDX-License-Identifier: GPL-3.0-or-later
"""What a control group allows, in the layouts in which systems and containers show it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from generator import cgroup

GIB = 2**30


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """machine(cgroup, mountinfo, files): /proc/self and the trees; {} in mountinfo is where they lie."""
    monkeypatch.setattr(cgroup, "_PROC", tmp_path / "proc")

    def make(groups: str, mounts: str, files: dict[str, str]) -> None:
        (tmp_path / "proc").mkdir()
        (tmp_path / "proc" / "cgroup").write_text(groups)
        (tmp_path / "proc" / "mountinfo").write_text(mounts.replace("{}", str(tmp_path / "sys")))
        for name, text in files.items():
            file = tmp_path / "sys" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)

    return make


V2 = "35 24 0:30 / {} rw,nosuid shared:9 - cgroup2 cgroup2 rw,nsdelegate\n"


def test_version_2_and_the_groups_above(machine) -> None:
    files = {
        "a.slice/memory.max": f"{8 * GIB}\n",
        "a.slice/job/memory.max": "max\n",
        "a.slice/job/memory.high": f"{9 * GIB}\n",
        "a.slice/cpu.max": "max 100000\n",
        "a.slice/job/cpu.max": "250000 100000\n",
    }
    machine("0::/a.slice/job\n", V2, files)
    assert cgroup.memory_limit() == 8 * GIB
    assert cgroup.core_limit() == 2.5
    assert cgroup.worthwhile(range(64)) == 3 and cgroup.worthwhile(range(2)) == 2


@pytest.mark.parametrize("group", ["/", "/../../kubepods/pod1/c2"])
def test_version_2_in_a_container(machine, group: str) -> None:
    machine(f"0::{group}\n", V2, {"memory.max": f"{GIB}\n", "cpu.max": "50000 100000\n"})
    assert cgroup.memory_limit() == GIB
    assert cgroup.worthwhile(range(8)) == 1


V1 = (
    "30 24 0:26 {root} {}/memory ro - cgroup cgroup rw,memory\n"
    "31 24 0:27 {root} {}/cpu,cpuacct ro - cgroup cgroup rw,cpu,cpuacct\n"
    "32 24 0:28 / {}/unified rw - cgroup2 cgroup2 rw\n"
)
GROUPS = "4:memory:/docker/abc\n2:cpu,cpuacct:/docker/abc\n1:name=systemd:/docker/abc\n0::/\n"


@pytest.mark.parametrize(("root", "below"), [("/", "docker/abc/"), ("/docker/abc", "")])
def test_version_1(machine, root: str, below: str) -> None:
    files = {
        f"memory/{below}memory.limit_in_bytes": f"{3 * GIB}\n",
        "memory/tasks": "",
        f"cpu,cpuacct/{below}cpu.cfs_quota_us": "400000\n",
        f"cpu,cpuacct/{below}cpu.cfs_period_us": "100000\n",
    }
    machine(GROUPS, V1.replace("{root}", root), files)
    assert cgroup.memory_limit() == 3 * GIB
    assert cgroup.core_limit() == 4
    assert cgroup.memory_bytes() <= 3 * GIB


def test_no_limit(machine) -> None:
    files = {
        "memory/memory.limit_in_bytes": "9223372036854771712\n",
        "cpu,cpuacct/cpu.cfs_quota_us": "-1\n",
        "cpu,cpuacct/cpu.cfs_period_us": "100000\n",
    }
    machine(GROUPS.replace("docker/abc", ""), V1.replace("{root}", "/"), files)
    assert cgroup.core_limit() == math.inf
    assert 0 < cgroup.memory_bytes() < 9e18, "the machine's"
    assert cgroup.worthwhile(range(8)) == 8


def test_where_there_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cgroup, "_PROC", tmp_path)
    assert cgroup.memory_limit() == cgroup.core_limit() == math.inf
    for odd in ("", "0::\n", "max\n", "-1 -1\n", "x y\n"):
        (tmp_path / "cpu.max").write_text(odd)
        assert cgroup.core_limit() == math.inf
