#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Puts the oldest and the newest bpy wheel for Python 3.11 into environments of their own, beside the
# one the build uses: 350 MB each, kept between calls. Prints their Pythons, separated by colons.
#
#     scripts/bpy_wheels.sh FOLDER [PYTHON]
set -eu
folder=$1
python=${2:-python3.11}
found=
for version in 4.2.23 5.0.1; do
    place=$folder/bpy-$version
    if [ ! -e "$place/.ready" ]; then
        echo "installing bpy $version into $place" >&2
        rm -rf "$place"
        "$python" -m venv "$place"
        "$place/bin/pip" install -q --disable-pip-version-check "bpy==$version" "numpy<3" >&2
        touch "$place/.ready"
    fi
    found=$found${found:+:}$(cd "$place" && pwd)/bin/python
done
echo "$found"
