# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads are placed with libraries of the build extra."""

from importlib.util import find_spec

collect_ignore_glob = [] if find_spec("cv2") and find_spec("embreex") else ["test_*.py"]
