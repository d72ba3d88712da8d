# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head wears: hair, glasses, hats, clothes and what is before it, fitted to its landmarks."""
