# SPDX-License-Identifier: MIT
"""Learn head-pose manifolds from Headturn's Parquet tables and estimate pose from landmarks.

The method is NLML-HPE (Ghafourian and Sukno): Tucker decomposition, cosine manifolds, an encoder
and three MLP heads. Angles are degrees in the order (yaw, pitch, roll); the rotation is R_C.
"""
