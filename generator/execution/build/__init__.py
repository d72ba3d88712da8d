# SPDX-License-Identifier: GPL-3.0-or-later
"""A build: plan, prepare, render, commit, sum up, and what its folder remembers."""
