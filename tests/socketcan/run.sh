#!/bin/sh
# Boots Debian's kernel in QEMU and runs the checks that need CAN in it; see docs/SOCKETCAN.md.
# Prints `passed NAME` or `failed NAME: why` for each check. Exit code 0: all checks passed; 77: the
# packages cannot be installed; 1: otherwise.
set -eu
here=$(dirname "$0")
# Seconds; a whole run takes about 30 on a machine with nothing else to do. The machine's own time is that
# of its instructions: on a slow host it is slow for everything in it, and its waits are over at once.
limit=1200
made=${CARGO_TARGET_DIR:-target}/socketcan

status=0
"$here/image.sh" "$made" || status=$?
[ $status != 77 ] || echo "SKIPPED: the port socketcan: in a CAN kernel: the line above says why" >&2
[ $status = 0 ] || exit $status

console=$made/console.log
# norandmaps: QEMU keeps what it has translated only for code at the address where it was before.
status=0
timeout --foreground --kill-after=10 $limit qemu-system-x86_64 \
    -M pc -accel tcg -icount shift=0,sleep=off -rtc clock=vm -smp 1 -m 512 -nodefaults -no-reboot -display none -nic none \
    -kernel "$made/vmlinuz" -initrd "$made/initrd" \
    -append "console=ttyS0 rdinit=/init quiet panic=-1 mitigations=off norandmaps tsc=reliable" \
    -object can-bus,id=bus -device kvaser_pci,canbus=bus -device kvaser_pci,canbus=bus \
    -serial file:"$console" </dev/null || status=$?
tr -d '\r' <"$console" >"$made/console.txt"
if [ $status != 0 ]; then
    cat "$made/console.txt"
    echo "the virtual machine did not end by itself within $limit s, or failed ($status)" >&2
    exit 1
fi
grep -E '^(passed |failed |  \| )' "$made/console.txt" || cat "$made/console.txt"

sed -n 's/^passed //p' "$made/console.txt" | sort >"$made/passed"
sort "$made/expected" | comm -3 "$made/passed" - >"$made/difference"
if [ -s "$made/difference" ] || ! [ -s "$made/passed" ]; then
    tail -n 5 "$made/console.txt" >&2
    echo "not passed: $(tr -s '\n\t' '  ' <"$made/difference")" >&2
    exit 1
fi
echo "all $(grep -c . "$made/passed") checks in the virtual machine passed"
