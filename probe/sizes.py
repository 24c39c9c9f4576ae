"""Flash and RAM of linked programs for a Cortex-M4, as docs/SIZES.md has them.

$ (cd probe && cargo build --release)
$ python3 probe/sizes.py FOLDER --check     # fails where a goal is missed
$ python3 probe/sizes.py FOLDER > docs/SIZES.md
"""

import struct
import subprocess
import sys
from pathlib import Path

PROGRAMS = {
    "empty": "an empty program",
    "st_slave": "ST slave",
    "st_master": "ST master",
    "rmd_drive": "RMD drive",
    "rmd_host": "RMD host, 32 motors",
    "slcan": "slcan, both ends",
    "everything": "both protocols, both ends",
}
GOALS = {"st_slave": (4096, 350), "rmd_drive": (3072, 200)}
"""Less than this of flash and of RAM."""

ALLOCATED, WRITABLE, NO_BITS, SYMBOLS = 2, 1, 8, 2


def parse(elf):
    """Sections as (name, type, flags, bytes), and functions as (name, bytes)."""
    data = elf.read_bytes()
    (table,) = struct.unpack_from("<I", data, 32)
    entry, count, names = struct.unpack_from("<HHH", data, 46)
    rows = [struct.unpack_from("<10I", data, table + entry * n) for n in range(count)]

    def text(strings, offset):
        start = rows[strings][4] + offset
        return data[start : data.index(b"\0", start)].decode()

    sections = [(text(names, row[0]), row[1], row[2], row[5]) for row in rows]
    functions = {}
    for row in rows:
        if row[1] == SYMBOLS:
            for at in range(row[4], row[4] + row[5], 16):
                name, value, size, info = struct.unpack_from("<IIIB", data, at)
                # A function may have several names.
                if info & 0xF == 2:
                    functions[value] = (text(row[6], name), size)
    return sections, list(functions.values())


def measure(elf):
    """Bytes of flash without and of the compiler's memory functions, and of RAM."""
    sections, functions = parse(elf)
    kept = [
        row for row in sections if row[2] & ALLOCATED and not row[0].startswith(".ARM")
    ]
    flash = sum(size for _, kind, _, size in kept if kind != NO_BITS)
    ram = sum(size for _, _, flags, size in kept if flags & WRITABLE)
    memory = sum(
        size for name, size in functions if "__aeabi_mem" in name or "compiler_builtins" in name
    )
    return flash - memory, memory, ram


def main(folder, *options):
    measured = {name: measure(Path(folder) / name) for name in PROGRAMS}
    bare, _, _ = measured["empty"]
    sizes = {name: (flash - bare, memory, ram) for name, (flash, memory, ram) in measured.items()}
    if "--check" in options:
        missed = False
        for name, goal in GOALS.items():
            flash, _, ram = sizes[name]
            print(f"{PROGRAMS[name]}: {flash} of {goal[0]} B flash, {ram} of {goal[1]} B RAM")
            missed |= flash >= goal[0] or ram >= goal[1]
        return missed
    compiler = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True)
    print(TEXT.format(compiler=compiler.stdout.split(" (")[0].strip(), bare=bare))
    sizes["empty"] = measured["empty"]
    for name, (flash, memory, ram) in sizes.items():
        goal = "below {} / {}".format(*GOALS[name]) if name in GOALS else ""
        print(f"| {PROGRAMS[name]} | {flash} | {memory} | {ram} | {goal} |")
    return False


TEXT = """\
# What the protocols take of a microcontroller

Written by `make sizes`. Bytes, from linked programs for a Cortex-M4 (thumbv7em-none-eabihf) that make
every call that firmware makes ([probe](../probe)), with `opt-level = "s"`, fat LTO, `panic = "abort"`
and {compiler}. `make probe` fails where a goal is missed.

- Flash is code and constants, register tables without names and texts, with what a call of the probe's
  own drive takes, less the {bare} bytes that an empty program has.
- Memory functions are the compiler's for copying and clearing (`__aeabi_memcpy` and its kin), which any
  firmware has once, whatever else is in it. They are not in the flash beside them.
- RAM is the state of the machines, in statics. The stack is not in it.

| | flash | memory functions | RAM | goal, flash / RAM |
|---|---:|---:|---:|---|"""

if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
