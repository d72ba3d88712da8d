# SPDX-License-Identifier: MIT
"""Encoder and heads: trained, calibrated, written as ONNX. Needs torch, but for augment and confidence."""
