# SPDX-License-Identifier: MIT
"""Head pose as a web page that runs in the browser and sends nothing anywhere."""
