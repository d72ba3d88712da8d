#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Brings up Debian's own Blender in a folder of its own, for tests against a real executable.
#
#     scripts/real_blender.sh [trixie|sid]     trixie has 4.3, sid the newest
#
# Prints the path of a `blender` command that behaves like an installed one: it sees the folders
# of users and temporary files at their own places. `run-<suite>` beside it runs anything there,
# such as xvfb-run. Needs root on Debian; takes one to three minutes the first time and nothing
# after that. Nothing stays mounted.
set -euo pipefail

suite=${1:-trixie}
base=${HEADTURN_BLENDER_ROOT:-/opt/headturn-blender}
root=$base/$suite
command=$base/blender-$suite
log=$base/$suite.log

if [ ! -e "$root/.ready" ]; then
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
        echo "scripts/real_blender.sh: needs root on Debian or Ubuntu; install Blender 4.2 or newer yourself" >&2
        exit 1
    fi
    mkdir -p "$base"
    echo "setting up Blender from Debian $suite in $root (one to three minutes, log in $log)" >&2
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

[ -e "$root/etc/mtab" ] || ln -s /proc/self/mounts "$root/etc/mtab"

# Each call gets a mount namespace of its own, so nothing outlives it. Without a PID namespace:
# xvfb-run hangs as process 1. Folders that are not part of a system keep their places, and
# $HEADTURN_OUTSIDE names a process outside, so that nsenter finds the way back to a host Python.
cat >"$base/run-$suite" <<EOF
#!/bin/bash
export HEADTURN_OUTSIDE=\$PPID
exec unshare --mount --propagation private bash -c '
    root=\$1; shift
    PATH=\$PATH:/usr/sbin  # where chroot is; a host that a Blender started has a short one
    for folder in /*; do
        case \$folder in
            /bin | /boot | /etc | /lib* | /opt | /run | /sbin | /sys | /usr | /var) continue ;;
        esac
        [ -d "\$folder" ] && [ ! -L "\$folder" ] || continue
        mkdir -p "\$root\$folder" && mount --rbind "\$folder" "\$root\$folder" || exit 1
    done
    kept=()
    for name in \$(compgen -e HEADTURN_; compgen -e BLENDER_; compgen -e DISPLAY; compgen -e TMPDIR); do
        kept+=("\$name=\${!name}")
    done
    mkdir -p "\$root/var/home"
    exec chroot "\$root" env -i HOME=/var/home LANG=C.UTF-8 PATH=/usr/bin:/bin "\${kept[@]}" \
        sh -c '\''cd "\$1" && shift && exec "\$@"'\'' sh "\$PWD" "\$@"
' bash "$root" "\$@"
EOF
printf '#!/bin/bash\nexec "%s/run-%s" blender "$@"\n' "$base" "$suite" >"$command"
chmod +x "$base/run-$suite" "$command"
echo "$command"
