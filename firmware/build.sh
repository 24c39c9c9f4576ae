#!/bin/sh
# Builds both boards into $CARGO_TARGET_DIR/firmware: board-rust.elf and board-c.elf.
set -eu
cd "$(dirname "$0")"
target=thumbv7em-none-eabihf
made=${CARGO_TARGET_DIR:-$PWD/target}
export CARGO_TARGET_DIR="$made"

${CARGO:-cargo} build --release --locked --quiet
mkdir -p "$made/firmware"
cp "$made/$target/release/board" "$made/firmware/board-rust.elf"
arm-none-eabi-gcc -std=c99 -Wall -Wextra -Werror -Os -g \
    -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 \
    -ffunction-sections -fdata-sections -nostartfiles --specs=nano.specs -Wl,--gc-sections -Wl,-z,noexecstack \
    -I ../crates/ffi/include -T board-c/board.ld board-c/startup.c board-c/main.c \
    "$made/$target/release/libmotorlink_plant.a" -o "$made/firmware/board-c.elf"
