#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# The browser in which the tests open report.html and the page of downstream-hpe demo. Installs Debian's Chromium when run as root on
# Debian; otherwise says what to install. Without one those tests are skipped, so this never fails.
set -eu

for browser in chromium chromium-browser google-chrome; do
    if command -v "$browser" >/dev/null; then exit 0; fi
done
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "installing chromium, in which the tests open the report and the demo (about a minute)"
    if apt-get update -qq &&
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium >/dev/null
    then
        exit 0
    fi
fi
echo "no Chromium: the tests that open the report and the demo in a browser will be skipped; to run them:" >&2
echo "    sudo apt-get install chromium" >&2
