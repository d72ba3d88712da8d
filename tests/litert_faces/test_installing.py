# SPDX-License-Identifier: MIT
"""The command that a message names is one that works where it is read."""

from __future__ import annotations

import json
from importlib import metadata

import pytest

from litert_faces.installing import CHECKOUT, install_command, numpy_clash


@pytest.mark.parametrize(
    ("source", "command"),
    [
        (None, "pip install 'headturn[build]'"),
        (
            {"url": "file:///a%20b/headturn", "dir_info": {"editable": True}},
            "pip install -e '/a b/headturn[build]'",
        ),
        ({"url": "file:///src/headturn", "dir_info": {}}, "pip install '/src/headturn[build]'"),
        ({"url": "file:///w/h.whl", "archive_info": {}}, "pip install 'headturn[build] @ file:///w/h.whl'"),
        (
            {"url": "https://example.org/h.git", "vcs_info": {"vcs": "git", "commit_id": "1a"}},
            "pip install 'headturn[build] @ git+https://example.org/h.git@1a'",
        ),
    ],
    ids=["index", "editable", "folder", "wheel", "git"],
)
def test_an_extra_comes_from_where_the_rest_came_from(
    source: dict | None, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Installed:
        def read_text(self, name: str) -> str | None:
            return json.dumps(source) if source is not None and name == "direct_url.json" else None

    monkeypatch.setattr(metadata, "distribution", lambda name: Installed())
    assert install_command("build") == command


def test_a_checkout_that_is_not_installed_names_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", nothing)
    assert install_command("hpe") == f"pip install -e '{CHECKOUT}[hpe]'"
    assert (CHECKOUT / "pyproject.toml").is_file()


def test_a_pyarrow_for_another_numpy_is_one_line_and_other_errors_are_not_touched() -> None:
    said = numpy_clash(ImportError("pyarrow requires NumPy 2.0 or newer, found 1.26.4"))
    assert said is not None and "found 1.26.4: pip install 'pyarrow<22'" in said
    assert numpy_clash(ImportError("cannot import name 'spline'")) is None
