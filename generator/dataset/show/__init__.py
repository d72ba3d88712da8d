# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset for people: card, pictures, report."""
