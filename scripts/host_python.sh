#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Writes a command that is a given Python with this checkout, also for a Blender that lives in a
# file system of its own (scripts/real_blender.sh), for HEADTURN_PYTHON.
#
#     scripts/host_python.sh PYTHON FILE
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
cat >"$2" <<EOF
#!/bin/sh
# A colour management that does not exist: no pixel may depend on it.
set -- env PYTHONPATH="$root" OCIO=/nowhere.ocio "$1" "\$@"
[ -z "\$HEADTURN_OUTSIDE" ] || set -- nsenter -t "\$HEADTURN_OUTSIDE" -m -r --wdns="\$PWD" "\$@"
exec "\$@"
EOF
chmod +x "$2"
