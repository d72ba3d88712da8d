# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and columns of a dataset: written, read, hashed."""
