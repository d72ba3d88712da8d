# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes out of Blender is read with libraries of the build extra."""

from importlib.util import find_spec

collect_ignore_glob = [] if find_spec("cv2") and find_spec("OpenEXR") else ["test_*.py"]
