#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# The shared libraries that the bpy, mediapipe and opencv wheels expect of the system.
# Installs what is missing when run as root on Debian or Ubuntu; otherwise says what to install.
set -eu

missing=
while read -r library package; do
    ldconfig -p | grep -q "^[[:space:]]*$library " || missing="$missing $package"
done <<EOF
libX11.so.6 libx11-6
libXrender.so.1 libxrender1
libXfixes.so.3 libxfixes3
libXi.so.6 libxi6
libXxf86vm.so.1 libxxf86vm1
libxkbcommon.so.0 libxkbcommon0
libSM.so.6 libsm6
libICE.so.6 libice6
libGL.so.1 libgl1
libEGL.so.1 libegl1
libGLESv2.so.2 libgles2
libgomp.so.1 libgomp1
libglib-2.0.so.0 libglib2.0-0
EOF

[ -n "$missing" ] || exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "installing system libraries:$missing"
    apt-get update -qq
    # shellcheck disable=SC2086
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
else
    echo "these system libraries are missing; install them and run make again:" >&2
    echo "    sudo apt-get install$missing" >&2
    exit 1
fi
