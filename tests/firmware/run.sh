#!/bin/sh
# Builds both boards, boots them in QEMU and runs tests/firmware against them. Ends with 77 where the
# packages for it cannot be had. PYTEST is how to run pytest, SUDO what makes a command root's.
set -eu
tests=$(cd "$(dirname "$0")" && pwd)
repository=$tests/../..
target=thumbv7em-none-eabihf
packages="qemu-system-arm gcc-arm-none-eabi libnewlib-arm-none-eabi"

unavailable() {
    cat >&2 <<NOTICE

  ****************************************************************************
  **                                                                        **
  **  NOT TESTED: the firmware, in Rust and in C, on an emulated board.      **
  **                                                                        **
  **  This needs Debian's packages qemu-system-arm, gcc-arm-none-eabi and    **
  **  libnewlib-arm-none-eabi, and the Rust target thumbv7em-none-eabihf:    **
  **  $1
  **  Run \`make firmware-test\` where they can be had.                       **
  **                                                                        **
  ****************************************************************************

NOTICE
    exit 77
}

missing=
for package in $packages; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' $package 2>/dev/null)" = installed ] ||
        missing="$missing $package"
done
if [ "$missing" ]; then
    command -v apt-get >/dev/null || unavailable "there is no apt-get."
    # shellcheck disable=SC2086
    { $SUDO apt-get update -q && $SUDO apt-get install -q -y --no-install-recommends $missing; } >&2 ||
        unavailable "packages cannot be installed."
fi
rustup target list --installed | grep -qx $target || rustup target add $target >&2 ||
    unavailable "rustup cannot add the target."

cd "$repository"
${CARGO:-cargo} build --quiet --locked -p motorlink-cli
firmware/build.sh
MOTORLINK_BIN=${CARGO_TARGET_DIR:-target}/debug/motorlink
MOTORLINK_FIRMWARE=${CARGO_TARGET_DIR:-firmware/target}/firmware
export MOTORLINK_BIN MOTORLINK_FIRMWARE
exec ${PYTEST:-python3 -m pytest} -q tests/firmware
