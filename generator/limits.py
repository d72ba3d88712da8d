# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a dataset may hold. stdlib only: Blender reads it, too."""

from __future__ import annotations

MAX_HEADS = 100_000
"""Of a dataset: every table of heads is held in memory."""

MAX_POSES = 5_000_000
"""Of a head."""

MAX_ROWS = 100_000_000
"""Of a dataset: so are the poses of every row while a build is planned."""

MAX_SEED = 2**63 - 1

MAX_WORKERS = 4096
"""Of a cluster."""
