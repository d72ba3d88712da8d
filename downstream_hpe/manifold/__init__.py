# SPDX-License-Identifier: MIT
"""The pose tensor taken apart, its pose manifolds, and the estimator by reconstruction."""
