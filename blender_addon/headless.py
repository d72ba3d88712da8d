# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn`` commands in a Blender that does not have the extension:

    blender --background --python-exit-code 1 --python blender_addon/headless.py -- build CONFIG.toml

Takes the same arguments as ``headturn`` and ends with the same exit code.
"""

from __future__ import annotations

import os
import shutil
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import bpy


def main() -> int:
    """Carry out what stands behind ``--``."""
    folder = Path(__file__).resolve().parent
    # The checkout, or the folder of an unpacked extension: its parts are a package either way. What else lies
    # beside an extension that somebody unpacked among his downloads is no place of modules.
    if (folder.parent / "generator").is_dir():
        sys.path.insert(0, str(folder.parent))
    spec = spec_from_file_location(
        folder.name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None, "a file that exists has a loader"
    sys.modules[folder.name] = module_from_spec(spec)
    headless = import_module(f"{folder.name}.core.headless")
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    return headless.run(arguments, blender=bpy.app.binary_path)


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender would turn any exit code of ours into its own, and tidies up only where it ends by itself.
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
