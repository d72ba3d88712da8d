# SPDX-License-Identifier: MIT
"""How far estimators are off, on tables and on labelled photographs."""
