# SPDX-License-Identifier: GPL-3.0-or-later
"""Who carries out orders: one lane, several, or a cluster."""
