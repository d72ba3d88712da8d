# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m generator.cli``."""

from generator.cli import main

main()
