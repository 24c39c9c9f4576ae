#!/bin/sh
# Builds the boards and the C library for microcontrollers, boots them in QEMU and runs
# tests/firmware. Exit code 77: the packages cannot be installed. MOTORLINK_BIN is the built
# program, PYTEST the command of pytest, SUDO the command that gives root rights.
set -eu
tests=$(cd "$(dirname "$0")" && pwd)
repository=$tests/../..
targets="thumbv6m-none-eabi thumbv7m-none-eabi thumbv7em-none-eabi thumbv7em-none-eabihf riscv32imac-unknown-none-elf"

unavailable() {
    echo "SKIPPED: the firmware on an emulated board: $1" >&2
    exit 77
}

"$repository/tests/install" firmware-test ||
    unavailable "packages are missing; as root: tests/install firmware-test"
# shellcheck disable=SC2086
rustup target add $targets >&2 || unavailable "rustup cannot add the targets $targets"

cd "$repository"
firmware/build.sh
MOTORLINK_FIRMWARE=${CARGO_TARGET_DIR:-$PWD/firmware/target}/firmware
export MOTORLINK_FIRMWARE
cd tests/firmware
exec ${PYTEST:-python3 -m pytest -q} "$@"
