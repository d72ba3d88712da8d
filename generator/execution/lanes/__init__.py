# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane: one render worker and one detector, in this process or another."""
