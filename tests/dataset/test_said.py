# SPDX-License-Identifier: GPL-3.0-or-later
"""What commands say at their end."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from generator.cli.build import _print_result
from generator.dataset.proof.verify import verify_dataset


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_build_says_how_many_rows_a_split_has(build, tmp_path, capsys, share):
    """A subject's name decides its split: of a few subjects, all may be on one side."""
    manifest = replace(build(tmp_path / "d"), configuration={"dataset": {"validation": share}})
    result = SimpleNamespace(manifest=manifest, root=tmp_path / "d", skipped=(), failed_units=0, pictures=())
    _print_result(result, 1.0, False)
    assert ("splits    18 rows in train, 18 rows in validation" in capsys.readouterr().out) == (share > 0)


def test_one_thing_is_not_called_several(build, tmp_path):
    from small_dataset import HEADS

    build(tmp_path / "d", heads=HEADS[:1])
    assert "18 rows of 1 head x 18 poses" in verify_dataset(tmp_path / "d").text()
