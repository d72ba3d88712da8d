# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong in a configuration is one line: which setting, and what would do."""

from __future__ import annotations

from pathlib import Path

import pytest

from generator.errors import UsageError
from generator.plan.config import load_config

CASES = {
    "[render]\nresolutoin = 64": "render.resolutoin: no such setting; there is resolution",
    "[heads]\nsead = 1": "heads.sead: no such setting; there is seed",
    "[landmarks]\nx = 1": "landmarks.x: no such setting; there is detector, also, file, min_confidence",
    "[rendr]\nresolution = 64": "rendr: no such section; there is render",
    "[render]\nlens_mm = 0": "render.lens_mm: Input should be greater than or equal to 10, got 0",
    '[render]\npreset = "fst"': "render.preset: Input should be 'fast' or 'quality', got 'fst'",
    '[render]\nresolution = "big"': "render.resolution: Input should be a valid integer",
    "[render": "",
}


@pytest.mark.parametrize("text", CASES, ids=lambda text: text.replace("\n", " "))
def test_one_line_says_what_is_wrong(text: str, tmp_path: Path) -> None:
    path = tmp_path / "build.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError) as caught:
        load_config(path, {})
    said = str(caught.value)
    assert CASES[text] in said and "\n" not in said
    assert said.startswith(str(path))
