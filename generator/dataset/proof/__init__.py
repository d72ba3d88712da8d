# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof that a dataset is complete, unchanged and consistent with itself."""
