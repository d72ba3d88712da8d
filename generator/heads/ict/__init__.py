# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads made of ICT-FaceKit (MIT, USC Institute for Creative Technologies), of which users bring a copy."""
