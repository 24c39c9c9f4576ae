#!/bin/sh
# Builds the boards into $CARGO_TARGET_DIR/firmware: board-rust.elf and board-c.elf; and, from an installed
# copy of the C library, its bare-metal example: board-example.elf with a time that a host steps, and
# real-time.elf.
set -eu
cd "$(dirname "$0")"
target=thumbv7em-none-eabihf
example=../crates/ffi/examples/bare-metal
made=${CARGO_TARGET_DIR:-$PWD/target}
export CARGO_TARGET_DIR="$made"

${CARGO:-cargo} build --release --locked --quiet
mkdir -p "$made/firmware"
cp "$made/$target/release/board" "$made/firmware/board-rust.elf"
arm-none-eabi-gcc -std=c99 -Wall -Wextra -Werror -Os -g \
    -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 \
    -ffunction-sections -fdata-sections -nostartfiles --specs=nano.specs -Wl,--gc-sections -Wl,-z,noexecstack \
    -I ../crates/ffi/include -I "$example" -T "$example/board.ld" \
    "$example/startup.c" "$example/board.c" board-c/clock.c board-c/main.c \
    "$made/$target/release/libmotorlink_plant.a" -o "$made/firmware/board-c.elf"

prefix=$made/firmware/installed
../crates/ffi/packaging/install "$prefix" "" "$target" >/dev/null
installed=$prefix/share/doc/motorlink/examples/bare-metal
for program in real-time board-example; do
    time=$([ "$program" = real-time ] && echo time.c || echo "$PWD/board-c/clock.c")
    make --silent --always-make -C "$installed" PREFIX="$prefix" TIME="$time"
    mv "$installed/drives.elf" "$made/firmware/$program.elf"
done
