# SPDX-License-Identifier: MIT
"""The face mesh, rotations, and what is measured of them: numpy alone."""
