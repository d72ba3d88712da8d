# SPDX-License-Identifier: MIT
"""``python -m downstream_hpe.cli``."""

from downstream_hpe.cli import main

main()
