# SPDX-License-Identifier: MIT
"""Faces that were found elsewhere: files of boxes, and what is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from clips import bars, make, rows_of
from PIL import Image

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.prediction.boxes import read_boxes
from downstream_hpe.prediction.inputs import find_sources


@pytest.fixture
def pictures(tmp_path):
    """Two of one name, with a face at column 25."""
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        Image.fromarray(bars(20)).save(tmp_path / name / "p.png")
    return tmp_path


def boxes_of(folder: Path, text: str, name: str = "boxes.csv", of: str = "."):
    (folder / name).write_text(text, encoding="utf-8")
    return read_boxes(folder / name, find_sources([str(folder / of)]))


def test_a_row_a_box_in_the_order_of_the_file(pictures):
    rows = [(20, 20, 10, 10), (50, 20, 8, 8), (18, 30, 12, 9)]
    text = "score, picture, x, y, w, h\n" + "".join(f"1,a/p.png,{','.join(map(str, row))}\n" for row in rows)
    entries = [dict(zip(("picture", "x", "y", "w", "h"), ("a/p.png", *row), strict=True)) for row in rows]
    for name, content in (("boxes.csv", text), ("boxes.json", json.dumps(entries))):
        boxes = boxes_of(pictures, content, name, "a")
        found, notes = rows_of(pictures / "a", boxes=boxes)
        assert notes == [] and [(row["face"], row["found"]) for row in found] == [
            (0, True),
            (1, False),
            (2, True),
        ]
        assert found[0]["box_x"] == pytest.approx(found[2]["box_x"] + 1, abs=0.02)
    # A picture without boxes has no face.
    (row,), _ = rows_of(pictures / "b", boxes=boxes)
    assert not row["found"] and row["face"] is None


def test_pictures_are_found_by_their_names(pictures, monkeypatch):
    boxes = boxes_of(pictures, "picture,x,y,w,h\na/p.png,1,2,3,4\n")
    assert boxes.found == {(pictures / "a" / "p.png").resolve(): {None: [(1, 2, 3, 4)]}}
    with pytest.raises(UsageError, match=r"boxes\.csv: line 2: p\.png is 2 of the inputs"):
        boxes_of(pictures, "picture,x,y,w,h\np.png,1,2,3,4\n")
    monkeypatch.chdir(pictures / "b")
    assert list(boxes_of(pictures, "picture,x,y,w,h\np.png,1,2,3,4\n").found) == [Path("p.png").resolve()]


BAD = {
    "columns": ("picture,left,top\n", "has no column x, y, w, h; expected a .csv file"),
    "no number": ("picture,x,y,w,h\na/p.png,1,two,3,4\n", "line 2: y is 'two'"),
    "not finite": ("picture,x,y,w,h\na/p.png,1,2,nan,4\n", "line 2: w is 'nan'"),
    "too few": ("picture,x,y,w,h\na/p.png,1\n", "line 2: y is None"),
    "no size": ("picture,x,y,w,h\na/p.png,1,2,0,4\n", "line 2: w and h are 0 and 4"),
    "nobody's": ("picture,x,y,w,h\nc.png,1,2,3,4\n", r"line 2: c\.png is none of the inputs"),
    "no picture": ("picture,x,y,w,h\n,1,2,3,4\n", "line 2: no picture"),
    "of no video": ("picture,frame,x,y,w,h\na/p.png,0,1,2,3,4\n", "line 2: frame is '0' of a picture"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_said(name, pictures):
    text, says = BAD[name]
    with pytest.raises((DataError, UsageError), match=says):
        boxes_of(pictures, text)


def test_other_files_and_inputs(pictures):
    for text in ("{", "{}", "[1]", '[{"picture": "a/p.png"}]', "[" * 9999):
        with pytest.raises(DataError, match=r"boxes\.json.*expected"):
            boxes_of(pictures, text, "boxes.json")
    with pytest.raises(UsageError, match=r"boxes\.txt: expected a \.csv file"):
        boxes_of(pictures, "", "boxes.txt")
    with pytest.raises(DataError, match="cannot be read"):
        read_boxes(pictures / "none.csv", [])
    with pytest.raises(UsageError, match="webcam:0: --boxes is for files, whose frames have"):
        read_boxes(pictures / "none.csv", find_sources(["webcam:0"]))
    boxes = boxes_of(pictures, "picture,x,y,w,h\na/p.png,500,2,3,4\n")
    rows, (note,) = rows_of(pictures / "a", boxes=boxes)
    assert not rows and "the box 500, 2, 3, 4 of" in note and "is not in its 64 x 64 pixels" in note


def test_boxes_of_a_video_are_those_of_its_frames(tmp_path):
    pytest.importorskip("av")
    clip = make(tmp_path / "a.mp4", "libx264", [bars(10 + 5 * n) for n in range(4)])
    lines = [
        "picture,frame,x,y,w,h",
        "a.mp4,0,12,30,5,5",
        "a.mp4,2,50,30,5,5",
        "a.mp4,2,22,30,5,5",
        "a.mp4,3,27,30,5,5",
    ]
    boxes = boxes_of(tmp_path, "\n".join(lines), of="a.mp4")
    rows, notes = rows_of(clip, boxes=boxes, drawn=tmp_path / "drawn.mp4", smooth=True)
    # Each row has its frame, and the number of the box in it; a frame without boxes has no face.
    assert [(row["frame"], row["face"], row["found"]) for row in rows] == [
        (0, 0, True),
        (1, None, False),
        (2, 0, False),
        (2, 1, True),
        (3, 0, True),
    ]
    assert notes == [] and (tmp_path / "drawn.mp4").is_file()
    rows, (note,) = rows_of(
        clip, boxes=boxes_of(tmp_path, "\n".join([*lines, "a.mp4,4,1,1,5,5"]), of="a.mp4")
    )
    assert len(rows) == 5 and note == f"{clip}: has 4 frames, from 0 on, and boxes for 1 others"
    assert rows_of(clip, boxes=boxes, frames=1)[1] == []
    rows, (note,) = rows_of(
        clip, boxes=boxes_of(tmp_path, "\n".join([*lines, "a.mp4,3,70,1,5,5"]), of="a.mp4")
    )
    assert not rows and "the box 70, 1, 5, 5 for frame 3 of" in note and "not in its 64 x 64 pixels" in note
    for frame in ("", "-1", "0.5", "x", "1e99"):
        with pytest.raises(DataError, match=rf"line 2: frame is '{frame}'; expected"):
            boxes_of(tmp_path, f"picture,frame,x,y,w,h\na.mp4,{frame},1,2,3,4\n", of="a.mp4")
    with pytest.raises(DataError, match="line 2: frame is None; expected"):
        boxes_of(tmp_path, "picture,x,y,w,h\na.mp4,1,2,3,4\n", of="a.mp4")
