# SPDX-License-Identifier: MIT
"""A model at work: landmarks, pictures, videos and webcams in, head pose out. Needs no torch."""
