# SPDX-License-Identifier: GPL-3.0-or-later
"""What each factor does to a detector and to models, from rows and their twins."""
