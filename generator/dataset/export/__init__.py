# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset in the forms other programs read. One format a module, with a Format called FORMAT."""
