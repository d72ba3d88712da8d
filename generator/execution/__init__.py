# SPDX-License-Identifier: GPL-3.0-or-later
"""Units of work to committed parts: lanes, executors, and the build that drives them."""
