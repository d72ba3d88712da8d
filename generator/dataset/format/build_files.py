# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of the files that a build keeps in a dataset for itself: no reader of rows needs them."""

from __future__ import annotations

RECEIPTS_FILE = "receipts.jsonl"
PLACED_FILE = "placed.jsonl"
FIRST_PLACED_FILE = "prepared.jsonl"
"""As the first release called it."""

LOG_FILE = "build.log"
