"""Flash and RAM of linked programs for a Cortex-M4, as docs/SIZES.md has them.

$ (cd probe && cargo build --release)
$ make install-c PREFIX=PREFIX TARGET=thumbv7em-none-eabihf
$ python3 probe/sizes.py FOLDER PREFIX --check     # fails where a limit is exceeded
$ python3 probe/sizes.py FOLDER PREFIX > docs/SIZES.md

Without arm-none-eabi-gcc the programs in C are not checked.
"""

import shutil
import struct
import subprocess
import sys
from pathlib import Path

import c_sizes

PROGRAMS = {
    "empty": "an empty program",
    "st_slave": "ST slave",
    "st_master": "ST master",
    "rmd_drive": "RMD drive",
    "rmd_host": "RMD host, 32 motors",
    "slcan": "slcan, both ends",
    "everything": "both protocols, both ends",
}
LIMITS = {"st_slave": (4096, 350), "rmd_drive": (3072, 200)}
"""Less than this of flash, without memory functions, and of RAM."""

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


def exceeds(name, limit, flash, ram):
    print(f"{name}: {flash} of {limit[0]} B flash, {ram} of {limit[1]} B RAM")
    return flash >= limit[0] or ram >= limit[1]


def in_c(prefix):
    return {name: c_sizes.measure(prefix, name) for name in c_sizes.PROGRAMS}


def in_rust(folder):
    measured = {name: measure(Path(folder) / name) for name in PROGRAMS}
    bare, _, _ = measured["empty"]
    sizes = {name: (flash - bare, memory, ram) for name, (flash, memory, ram) in measured.items()}
    sizes["empty"] = measured["empty"]
    return sizes


def check(folder, prefix):
    """Prints what has a limit; whether one is exceeded."""
    rust = in_rust(folder)
    rows = [(f"Rust: {PROGRAMS[name]}", limit, rust[name][0], rust[name][2]) for name, limit in LIMITS.items()]
    if shutil.which(c_sizes.COMPILER):
        c = in_c(prefix)
        rows += [(f"C: {PROGRAMS[name]}", limit, c[name][0], c[name][2]) for name, limit in c_sizes.LIMITS.items()]
    else:
        print(f"SKIPPED: flash and RAM from C: {c_sizes.COMPILER} is not installed", file=sys.stderr)
    return any([exceeds(*row) for row in rows])


def version(compiler):
    told = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True)
    return told.stdout.splitlines()[0]


def limits(of, name):
    return "below {} / {}".format(*of[name]) if name in of else ""


def document(folder, prefix):
    rust = in_rust(folder)
    compiler = version("rustc").split(" (")[0]
    c_compiler = f"{c_sizes.COMPILER} {version(c_sizes.COMPILER).rsplit(maxsplit=2)[-2]}"
    print(TEXT.format(compiler=compiler, c_compiler=c_compiler))
    print("| from C | flash | of it libgcc | RAM | limit, flash / RAM |\n|---|---:|---:|---:|---|")
    for name, (flash, others, ram) in in_c(prefix).items():
        print(f"| {PROGRAMS[name]} | {flash} | {others} | {ram} | {limits(c_sizes.LIMITS, name)} |")
    print(RUST_TEXT.format(bare=rust["empty"][0]))
    for name, (flash, memory, ram) in rust.items():
        print(f"| {PROGRAMS[name]} | {flash} | {memory} | {ram} | {limits(LIMITS, name)} |")


TEXT = """\
# Flash and RAM on a microcontroller

For firmware authors: what a part of Motorlink adds to a program. `make sizes` writes this page. All
numbers are bytes of linked programs for a Cortex-M4 with FPU (thumbv7em-none-eabihf). `make probe`
fails where a limit is exceeded.

## From C

The library that `make install-c TARGET=thumbv7em-none-eabihf` installs ({compiler},
`opt-level = "z"`), linked by {c_compiler} with `-Os -Wl,--gc-sections` to the
programs of [probe/c](../probe/c). They make every call of a drive, or the usual calls of a host.

- Flash is all code and constants that the linker takes from libraries: from Motorlink's with its
  memory functions, and from the compiler's libgcc. The program's own code and callbacks are not in
  it.
- RAM is the object that the program declares. The stack is not in it: see "Cost" in motorlink.h.

The goals are less than 4096 bytes of flash for an ST slave and less than 3072 for an RMD drive,
with everything in it. **Both goals are reached.** This takes the bytes:

- The C interface checks pointers and objects, and calls through a table. In Rust the compiler
  removes most of this. Structs of C have the layout of those in Rust, so they are not converted.
- The protocol: table of registers, both profiles, data segments, ranges, checksums, replies. An ST
  slave has all of it, because the profile and the registers are only known at run time.
- A frame pointer in each function, which Rust's targets for these processors demand.

There are no panics, no texts and no formatting in these programs. Two options of LLVM in
`crates/ffi/bare-metal/.cargo/config.toml` save about 530 bytes of an ST slave and 270 of an RMD
drive.
"""

RUST_TEXT = """
## From Rust

Programs that make every call that firmware makes ([probe](../probe)), with `opt-level = "s"`, fat
LTO and `panic = "abort"`.

- Flash is code and constants, with the register table but without names and texts, and with what a
  call of the probe's own drive takes, less the {bare} bytes of an empty program.
- Memory functions are the compiler's for copying and clearing (`__aeabi_memcpy` and its kin). A
  program in Rust has them once, whatever else is in it. They are not in the flash beside them.
- RAM is the state of the machines, in statics. The stack is not in it.

| from Rust | flash | memory functions | RAM | limit, flash / RAM |
|---|---:|---:|---:|---|"""

if __name__ == "__main__":
    _, folder, prefix, *options = sys.argv
    sys.exit(check(folder, prefix) if "--check" in options else document(folder, prefix))
