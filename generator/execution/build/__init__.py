# SPDX-License-Identifier: GPL-3.0-or-later
"""A build: plan, place, render, commit, sum up, and what its folder remembers."""
