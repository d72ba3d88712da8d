# SPDX-License-Identifier: MIT
"""Headturn's Parquet tables: opened, checked, read as rows or as the pose tensor."""
