"""Flash and RAM of Motorlink in programs in C, which an installed library is linked to."""

import re
import subprocess
import tempfile
from pathlib import Path

PROGRAMS = {
    "st_slave": "ST slave",
    "st_master": "ST master",
    "rmd_drive": "RMD drive",
    "rmd_host": "RMD host, 32 motors",
}
LIMITS = {"st_slave": (4096, 350), "rmd_drive": (3072, 200)}
"""Less than this of flash, memory functions and all, and of RAM."""

TARGET = "thumbv7em-none-eabihf"

COMPILER = "arm-none-eabi-gcc"
FLAGS = "-std=c99 -Wall -Wextra -pedantic -Werror -Os -ffunction-sections -fdata-sections".split()
CORE = "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16".split()
LINKER = "-nostartfiles -Wl,-e,main -Wl,--gc-sections -Wl,-z,noexecstack".split()
HERE = Path(__file__).parent


def measure(prefix, program):
    """Bytes of flash from libraries, those of them that are not Motorlink's, and bytes of RAM."""
    with tempfile.TemporaryDirectory() as folder:
        listing = Path(folder) / "map"
        library = [f"-I{prefix}/include", f"-L{prefix}/lib/{TARGET}", "-lmotorlink"]
        output = ["-o", f"{folder}/program", f"-Wl,-Map={listing}"]
        command = [COMPILER, *FLAGS, *CORE, *LINKER, HERE / "c" / f"{program}.c", *library, *output]
        subprocess.run(command, check=True)
        linked = listing.read_text().split("Linker script and memory map", 1)[1]
    sections = re.findall(r"^ \.(\S+)\s+0x[0-9a-f]+\s+0x([0-9a-f]+) (\S+)$", linked, re.M)
    flash = ram = others = 0
    for name, digits, file in sections:
        size = int(digits, 16)
        if name == "bss.state":
            ram += size
        elif file.endswith(")") and name.split(".")[0] in ("text", "rodata", "data"):
            flash += size
            others += 0 if "libmotorlink.a" in file else size
    return flash, others, ram
