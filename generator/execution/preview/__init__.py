# SPDX-License-Identifier: GPL-3.0-or-later
"""Single pictures, and the server that an interface asks for them."""
