# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that says what a .blend holds: ``python -m generator.blender.describe FILE ANSWER HEAD_OBJECT``.

The answer is JSON: error, or "" with head_object, shape_keys, problems, and files outside of the .blend.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

from generator.blender.outside import outside
from generator.blender.scene_file import find_head, open_scene, problems_of_scripts, shape_keys_of
from generator.errors import HeadError


def main(source: str, answer: str, head_object: str) -> None:
    """Write what is to be said of source into the file answer."""
    said: dict[str, object] = {"error": ""}
    try:
        open_scene(Path(source), whole=False)
        thing = find_head(head_object)
        said |= {
            "head_object": thing.name,
            "shape_keys": shape_keys_of(thing),
        }
        there = outside()
        said |= {"files": there.files, "problems": (*problems_of_scripts(), *there.problems)}
    except HeadError as error:
        said["error"] = str(error)
    Path(answer).write_text(json.dumps(said), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
    os._exit(0)  # Blender may never come to an end by itself
