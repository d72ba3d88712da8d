# SPDX-License-Identifier: MIT
"""Faces and their landmarks by MediaPipe's TFLite files, run by LiteRT: MediaPipe's graphs without its wheel.

Both generator and downstream_hpe import it; it imports neither. Pictures are uint8 [H, W, 3], RGB; points are
isotropic pixels of frame C, (x right, y down, z into the scene), the first pixel's centre at (0.5, 0.5).
"""
