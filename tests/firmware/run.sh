#!/bin/sh
# Builds both boards, boots them in QEMU and runs tests/firmware against them. Ends with 77 where the
# packages cannot be installed. MOTORLINK_BIN is the built program, PYTEST how to run pytest, SUDO what
# makes a command root's.
set -eu
tests=$(cd "$(dirname "$0")" && pwd)
repository=$tests/../..
target=thumbv7em-none-eabihf

unavailable() {
    echo "SKIPPED: the firmware on an emulated board: $1" >&2
    exit 77
}

"$repository/tests/install" firmware-test ||
    unavailable "packages are missing; as root: tests/install firmware-test"
rustup target list --installed | grep -qx $target || rustup target add $target >&2 ||
    unavailable "rustup cannot add the target $target"

cd "$repository"
firmware/build.sh
MOTORLINK_FIRMWARE=${CARGO_TARGET_DIR:-$PWD/firmware/target}/firmware
export MOTORLINK_FIRMWARE
cd tests/firmware
exec ${PYTEST:-python3 -m pytest -q} "$@"
