#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Brings up Debian's own Blender in a folder of its own, for tests against a real executable.
#
#     scripts/real_blender.sh [trixie|sid]     trixie has 4.3, sid the newest
#
# Prints the path of a `blender` command that behaves like an installed one: it sees this
# checkout, the current folder, /tmp and /dev/shm at their own places. Needs root on Debian;
# takes about three minutes the first time and nothing after that. Nothing stays mounted.
set -euo pipefail

suite=${1:-trixie}
base=${HEADTURN_BLENDER_ROOT:-/opt/headturn-blender}
root=$base/$suite
command=$base/blender-$suite
checkout=$(cd "$(dirname "$0")/.." && pwd)
log=$base/$suite.log

if [ ! -e "$root/.ready" ]; then
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
        echo "scripts/real_blender.sh: needs root on Debian or Ubuntu; install Blender 4.2 or newer yourself" >&2
        exit 1
    fi
    mkdir -p "$base"
    echo "setting up Blender from Debian $suite in $root (about three minutes, log in $log)" >&2
    {
        rm -rf "$root"
        apt-get update -qq
        apt-get install -y -qq --no-install-recommends debootstrap debian-archive-keyring
        mirror=$(cat /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list 2>/dev/null |
            awk '/^URIs:/{print $2; exit} /^deb /{for (i = 2; i <= NF; i++) if ($i ~ /:\/\//) {print $i; exit}}')
        debootstrap --variant=minbase --keyring=/usr/share/keyrings/debian-archive-keyring.gpg \
            "$suite" "$root" "$mirror"
        cp /etc/resolv.conf "$root/etc/"
        printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d"
        chmod +x "$root/usr/sbin/policy-rc.d"
        echo force-unsafe-io >"$root/etc/dpkg/dpkg.cfg.d/02unsafe"
        printf '%s\n' 'Acquire::Check-Valid-Until "false";' 'Acquire::Check-Date "false";' \
            'APT::Install-Recommends "false";' >"$root/etc/apt/apt.conf.d/99build"
        extra=
        [ "$suite" = trixie ] || extra=python3-cattr
        chroot "$root" env LC_ALL=C DEBIAN_FRONTEND=noninteractive sh -c "apt-get update -qq &&
            apt-get install -y -qq blender xvfb xauth imagemagick libgl1-mesa-dri libegl1 \
            python3-numpy python3-requests python3-zstandard $extra && apt-get clean"
        touch "$root/.ready"
    } >"$log" 2>&1 || { tail -n 5 "$log" >&2; echo "scripts/real_blender.sh: failed, see $log" >&2; exit 1; }
fi

# Each call gets a mount namespace of its own, so nothing outlives it. Without a PID namespace:
# xvfb-run hangs as process 1.
cat >"$command" <<EOF
#!/bin/bash
exec unshare --mount --propagation private bash -c '
    root=\$1; checkout=\$2; shift 2
    mount --rbind /proc "\$root/proc"
    mount --rbind /dev "\$root/dev"
    for folder in "\$checkout" "\$PWD" /tmp \${HEADTURN_BIND:-}; do
        [ -d "\$folder" ] && [ "\$folder" != / ] || continue
        mkdir -p "\$root\$folder"
        mount --rbind "\$folder" "\$root\$folder"
    done
    exec chroot "\$root" env -i HOME=/root LANG=C.UTF-8 PATH=/usr/bin:/bin PYTHONPATH= \\
        DISPLAY="\${DISPLAY:-}" BLENDER_USER_RESOURCES="\${BLENDER_USER_RESOURCES:-}" \\
        sh -c '\''cd "\$1" && shift && exec blender "\$@"'\'' sh "\$PWD" "\$@"
' bash "$root" "$checkout" "\$@"
EOF
chmod +x "$command"
echo "$command"
