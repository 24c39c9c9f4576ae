#!/bin/sh
# Makes the folder $1 with what the virtual machine boots: `vmlinuz`, Debian's kernel, and
# `initrd`, an image of busybox, the kernel's CAN modules, iproute2, can-utils, our
# programs and the checks. Debian's kernel and busybox are unpacked there, never installed.
# Ends with 77 where the packages cannot be had. MOTORLINK_BIN
# is the built program, SUDO is what makes a command root's.
set -eu
tests=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1"
made=$(cd "$1" && pwd)
unpacked=$made/debian
PATH=$PATH:/usr/sbin:/sbin

unavailable() {
    echo "$1" >&2
    exit 77
}

# The package $1 into the folder `debian`, without installing it.
unpack() {
    (cd "$made" && apt-get download -q -o APT::Sandbox::User=root "$1") &&
        dpkg -x "$made/$1"_*.deb "$unpacked" && rm "$made/$1"_*.deb
}

unpack_debian() {
    [ -e "$unpacked/complete" ] && return 0
    rm -rf "$unpacked" "$made"/*.deb
    kernel=$(apt-cache depends linux-image-amd64 | sed -n 's/^ *Depends: \(linux-image-[0-9].*\)/\1/p')
    # The drivers of everything but CAN take 300 MB.
    [ "$kernel" ] && unpack "$kernel" && unpack busybox-static &&
        find "$unpacked/lib/modules" -name '*.ko' ! -path '*/net/can/*' -delete &&
        touch "$unpacked/complete"
}

"$tests/../install" test-socketcan ||
    unavailable "packages are missing; as root: tests/install test-socketcan"
# The lists of packages must not change during this.
exec 9>"${TMPDIR:-/tmp}/motorlink-apt-$(id -u).lock"
flock 9
unpack_debian >&2 || unavailable "Debian's kernel cannot be downloaded"
exec 9>&-
# The tests of the port as the other parts of `make test` build them.
port=$(${CARGO:-cargo} test --workspace --all-features --test socketcan --no-run --locked \
    --message-format=json-render-diagnostics | sed -n 's/.*"executable":"\([^"]*\)".*/\1/p')
[ -x "$port" ]

root=$made/root
rm -rf "$root"
mkdir -p "$root/bin" "$root/sbin" "$root/tests"
version=$(cd "$unpacked/lib/modules" && echo *)
modules=lib/modules/$version
mkdir -p "$root/$modules/kernel/net" "$root/$modules/kernel/drivers/net"
cp "$unpacked/$modules"/modules.* "$root/$modules"
cp -r "$unpacked/$modules/kernel/net/can" "$root/$modules/kernel/net"
cp -r "$unpacked/$modules/kernel/drivers/net/can" "$root/$modules/kernel/drivers/net"
depmod -b "$root" "$version"
cp "$unpacked/bin/busybox" "$root/bin"
strip -o "$root/bin/motorlink" "$MOTORLINK_BIN"
strip -o "$root/tests/port" "$port"
cp "$tests/checks.sh" "$root/tests"
cp "$tests/init" "$root"
# busybox prefers its own `ip`: ours is called by its path.
cp "$(command -v ip)" "$root/sbin"
for tool in candump cansend slcan_attach; do
    cp "$(command -v $tool)" "$root/bin"
done
ldd "$MOTORLINK_BIN" "$port" "$root/sbin/ip" "$root/bin/candump" "$root/bin/cansend" "$root/bin/slcan_attach" |
    grep -o '/[^ ]*\.so[^ ]*' | sort -u | xargs -I {} cp -L --parents {} "$root"
(cd "$root" && find . | cpio -o -H newc -R 0:0 --quiet) >"$made/initrd"
cp "$unpacked/boot/vmlinuz-$version" "$made/vmlinuz"

# What has to pass, one name a line.
{
    "$port" --list --format terse >"$made/tests"
    sed -n 's/: test$//p' "$made/tests"
    sh "$tests/checks.sh" list
} >"$made/expected"
