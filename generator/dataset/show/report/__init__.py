# SPDX-License-Identifier: GPL-3.0-or-later
"""report.html: a dataset on one page, with the map of the detector's error."""
