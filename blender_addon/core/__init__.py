# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that needs no Blender: the host, its processes, the configuration, the grid."""
