# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines that are read at once say the same as lines that are read one by one."""

from __future__ import annotations

import numpy as np
import pytest

from generator.errors import HeadError
from generator.heads.obj_lines import ObjLines, parse_lines

POINTS = "v 0.1 -2 3e-2\nv 4 5 6.25\nv 7 8 9\nv 1 1 2\n"
UV = "vt 0.1 0.25\nvt 1 0\nvt .5 .5\nvt 1 1\n"


def arrays(obj: ObjLines) -> dict[str, list]:
    return {name: list(value) for name, value in vars(obj).items()}


@pytest.mark.parametrize("form", ["{0}", "{0}/{1}", "{0}/{1}/{0}", "{0}//{0}"])
@pytest.mark.parametrize("count", [3, 4])
def test_runs_are_read_as_single_lines_are(form: str, count: int) -> None:
    corners = [form.format(index, 5 - index) for index in (1, 2, 3, 4)][:count]
    text = (
        f"{POINTS}{UV}vn 0 0 1\n" + f"f {' '.join(corners)}\n" * 3 + "usemtl b\n" + f"f {' '.join(corners)}\n"
    )
    one_by_one = text.replace("f ", "f\t").replace("v ", "v\t").replace("vt ", "vt\t")
    assert arrays(parse_lines(text)) == arrays(parse_lines(one_by_one))
    obj = parse_lines(text)
    assert obj.table(obj.positions, 3)[0].tolist() == [0.1, -2, 0.03]
    assert list(obj.corner_uv) == ([0] if "/{1}" not in form else [4, 3, 2, 1][:count]) * (
        4 * count if "/{1}" not in form else 4
    )
    assert list(obj.face_material) == [0, 0, 0, 1]


@pytest.mark.parametrize(
    "line", ["f 1 2 3 4 5", "f -4 -3 -2", "f 1/1 2 3/3", "f 1 2", "f 0 1 2", "f 1 2 1234567890123", "f a b c"]
)
def test_a_special_line_in_a_run_is_read_or_named(line: str) -> None:
    text = f"{POINTS}{UV}" + "f 1 2 3\n" * 4 + line + "\nf 1 2 3\n"
    if line in ("f 1 2", "f 0 1 2", "f 1 2 1234567890123", "f a b c"):
        with pytest.raises(HeadError, match=rf"line 13 cannot be read: '{line}'"):
            parse_lines(text)
    else:
        assert len(parse_lines(text).face_corners) == 6


def test_blocks_and_vertices_with_and_without_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("generator.heads.obj_lines._BLOCK", 30)
    colored = "".join(f"{line} 1 0.5 0\n" for line in POINTS.splitlines())
    obj = parse_lines(colored + UV + "f 1 2 3\n")
    assert obj.table(obj.colors, 3).tolist() == [[1, 0.5, 0]] * 4
    np.testing.assert_array_equal(obj.table(obj.uvs, 2)[1], [1, 0])
    for mixed in (colored + POINTS, POINTS + colored, colored + "v\t1 2 3\n"):
        assert not parse_lines(mixed).colors
    with pytest.raises(HeadError, match="line 15 "):
        parse_lines(POINTS + UV + "f 1 2 3\n" * 6 + "f x\n")


@pytest.mark.parametrize("shared", [0, 1 << 20])
def test_lines_that_were_read_before_are_the_same_again(monkeypatch: pytest.MonkeyPatch, shared: int) -> None:
    """Faces and texture coordinates are those of the head before; vertices and materials its own."""
    monkeypatch.setattr("generator.heads.obj_lines._SHARED", shared)
    faces = "f 1/4 2/3 3/2\nf 2/3 3/2 4/1\n"
    first = parse_lines(f"{POINTS}{UV}usemtl a\n{faces}")
    other = parse_lines(f"{POINTS.replace('7', '70')}{UV}usemtl b\n{faces[:14]}usemtl a\n{faces}")
    assert list(other.corner_position) == [1, 2, 3, *first.corner_position]
    assert list(other.corner_uv) == [4, 3, 2, *first.corner_uv] and other.uvs == first.uvs
    assert list(other.face_material) == [0, 1, 1] and list(other.materials) == ["b", "a"]
    assert first.positions[6] == 7 and other.positions[6] == 70
    for _ in range(2):
        with pytest.raises(HeadError, match="line 9 cannot be read: 'f 0 1 2'"):
            parse_lines(f"{POINTS}{UV}f 0 1 2\n")
