# SPDX-License-Identifier: GPL-3.0-or-later
"""The dataset on disk: schema, parts, manifest, verification, pictures. No bpy."""
