"""The installed library of each microcontroller, linked by its C compiler and run in QEMU."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
INSTALL = HERE / "../../crates/ffi/packaging/install"
CORTEX_M_MEMORY = "-Wl,-e,vectors,--section-start=.vectors=0,-Ttext=0x400,-Tbss=0x20000000"
ARM = ["arm-none-eabi-gcc", "-mthumb", "cortex_m.c", CORTEX_M_MEMORY]
RISCV_MEMORY = "-Wl,--section-start=.vectors=0x80000000,-Ttext=0x80000400"
RISCV = ["riscv64-unknown-elf-gcc", "riscv.c", RISCV_MEMORY]
QEMU_RISCV = ["qemu-system-riscv32", "-M", "virt", "-bios", "none"]
TARGETS = {
    "thumbv6m-none-eabi": ([*ARM, "-mcpu=cortex-m0"], ["qemu-system-arm", "-M", "microbit"]),
    "thumbv7m-none-eabi": ([*ARM, "-mcpu=cortex-m3"], ["qemu-system-arm", "-M", "lm3s6965evb"]),
    "thumbv7em-none-eabi": ([*ARM, "-mcpu=cortex-m4"], ["qemu-system-arm", "-M", "mps2-an386"]),
    "thumbv7em-none-eabihf": (
        [*ARM, "-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],
        ["qemu-system-arm", "-M", "mps2-an386"],
    ),
    "riscv32imac-unknown-none-elf": ([*RISCV, "-march=rv32imac", "-mabi=ilp32"], QEMU_RISCV),
}
STRICT = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Os"]


# The processor with the fewest instructions, and the one of another family.
ALWAYS = ("thumbv6m-none-eabi", "riscv32imac-unknown-none-elf")


@pytest.fixture(
    scope="module",
    params=[pytest.param(it, marks=() if it in ALWAYS else pytest.mark.long) for it in TARGETS],
)
def installed(request, tmp_path_factory):
    """A target, and the prefix in which its library is installed."""
    compiler, emulator = TARGETS[request.param]
    missing = [tool for tool in (compiler[0], emulator[0]) if not shutil.which(tool)]
    if missing:
        pytest.skip(f"{' and '.join(missing)} is not installed: tests/install firmware-test")
    prefix = tmp_path_factory.mktemp("prefix")
    subprocess.run([INSTALL, prefix, "", request.param], check=True)
    return request.param, prefix


def pkg_config(prefix, target):
    """What pkg-config tells a build for this target."""
    environment = os.environ | {"PKG_CONFIG_LIBDIR": str(prefix / "lib" / target / "pkgconfig")}
    command = ["pkg-config", "--cflags", "--libs", "motorlink"]
    return subprocess.check_output(command, env=environment, text=True).split()


def test_both_ends_of_both_protocols_work_on_the_processor(installed, tmp_path):
    target, prefix = installed
    compiler, emulator = TARGETS[target]
    # Neither a C library nor start-up files: the library needs the compiler's own arithmetic only.
    program = tmp_path / "loopback"
    flags = [*STRICT, "-ffreestanding", "-nostdlib", "-Wl,--gc-sections", *pkg_config(prefix, target), "-lgcc", "-o", program]
    subprocess.run([*compiler, "loopback.c", *flags], cwd=HERE / "loopback", check=True)
    options = ["-nographic", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]
    run = subprocess.run([*emulator, *options, "-kernel", program], timeout=30)
    assert run.returncode == 0, f"line {run.returncode} of loopback.c, modulo 256"


def test_every_function_links_beside_a_c_library(installed, tmp_path):
    target, prefix = installed
    header = (prefix / "include/motorlink.h").read_text()
    code = re.sub(r"/\*.*?\*/", "", header, flags=re.S)
    functions = sorted(set(re.findall(r"^[\w ]+?\**\b(motorlink_\w+)\(", code, re.M)))
    assert len(functions) > 80
    source = tmp_path / "every.c"
    table = ", ".join(f"(function)&{name}" for name in functions)
    source.write_text(
        "#include <motorlink.h>\n#include <string.h>\n#include <stdlib.h>\ntypedef void (*function)(void);\n"
        f"extern function volatile every[];\nfunction volatile every[] = {{ {table} }};\n"
        "int main(void) { static char a[99], b[99]; memcpy(a, b, (size_t)rand() % 99); memset(b, a[0], 9);\n"
        "  return memcmp(a, b, sizeof a) + (int)((uint64_t)rand() / (uint64_t)rand()); }\n"
    )
    compiler = [word for word in TARGETS[target][0] if word[-2:] != ".c" and word[:4] != "-Wl,"]
    c_library = ["--specs=nosys.specs" if compiler[0].startswith("arm") else "--specs=picolibc.specs"]
    # Every member of the archive: none clashes with newlib or picolibc.
    whole = "-Wl,--whole-archive,-lmotorlink,--no-whole-archive"
    library = [whole if word == "-lmotorlink" else word for word in pkg_config(prefix, target)]
    subprocess.run([*compiler, *STRICT, source, *library, *c_library, "-o", tmp_path / "every"], check=True)


def test_cmake_finds_the_library_of_the_target(installed, tmp_path):
    target, prefix = installed
    compiler, *flags = (word for word in TARGETS[target][0] if word[-2:] != ".c")
    sources = [HERE / "loopback" / name for name in ("loopback.c", *TARGETS[target][0]) if name[-2:] == ".c"]
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.13)\nproject(loopback C)\nfind_package(motorlink 0.1 REQUIRED)\n"
        f"add_executable(loopback {' '.join(map(str, sources))})\n"
        "target_link_libraries(loopback PRIVATE motorlink::motorlink gcc)\n"
    )
    options = {
        "CMAKE_SYSTEM_NAME": "Generic",
        "CMAKE_C_COMPILER": compiler,
        "CMAKE_C_FLAGS": " ".join([*flags, "-Os -ffreestanding -nostdlib -Wl,--gc-sections"]),
        "CMAKE_TRY_COMPILE_TARGET_TYPE": "STATIC_LIBRARY",
        "motorlink_DIR": prefix / "lib" / target / "cmake/motorlink",
    }
    defines = [f"-D{name}={value}" for name, value in options.items()]
    subprocess.run(["cmake", "-S", tmp_path, "-B", tmp_path / "build", *defines], check=True)
    subprocess.run(["cmake", "--build", tmp_path / "build"], check=True)
    assert (tmp_path / "build/loopback").exists()


def refused(*words, **environment):
    """The message with which the installation fails."""
    run = subprocess.run([INSTALL, *words], env=os.environ | environment, capture_output=True, text=True)
    assert run.returncode == 1
    return run.stderr


def test_an_unknown_target_is_refused_with_the_list(tmp_path):
    message = refused(tmp_path, "", "thumbv8m.base-none-eabi")
    assert "unknown target thumbv8m.base-none-eabi" in message and "thumbv6m-none-eabi" in message
    assert not list(tmp_path.iterdir())


def test_a_missing_compiler_is_named(tmp_path):
    message = refused(tmp_path, "", "thumbv7em-none-eabihf", CROSS_COMPILE="no-such-")
    assert "no-such-ar is not installed" in message


def test_a_library_with_a_panic_is_not_installed(tmp_path):
    tools, prefix = tmp_path / "tools", tmp_path / "prefix"
    tools.mkdir()
    (tools / "arm-ar").symlink_to(shutil.which("arm-none-eabi-ar"))
    (tools / "arm-nm").write_text("#!/bin/sh\necho '         U __aeabi_uldivmod\n         U rust_begin_unwind'\n")
    (tools / "arm-nm").chmod(0o755)
    message = refused(prefix, "", "thumbv7em-none-eabihf", CROSS_COMPILE=f"{tools}/arm-")
    assert message.rstrip().endswith("U rust_begin_unwind") and "__aeabi_uldivmod" not in message
    assert not list(prefix.rglob("libmotorlink.a"))
