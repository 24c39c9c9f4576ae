"""Every code block of README.md and the pages runs: blocks.py says how."""

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import jsonschema
import pytest

import blocks
from blocks import PAGES, REPOSITORY, WORDS
from shell import LIMIT, lines, simulated

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]


def each(found):
    """A test a block."""
    return pytest.mark.parametrize("block", found, ids=map(str, found))


def each_page(found):
    """A test a page."""
    return pytest.mark.parametrize("found", found.values(), ids=list(found))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_names_its_language_and_its_check(page):
    found, indented = blocks.read(page)
    assert not indented, f"{page.name}: code without a fence in the lines {indented}"
    for block in found:
        assert block.word in WORDS.get(block.language, ()), (
            f"{block}: `{block.language} {block.word}` is not one of {WORDS}"
        )


@each_page(blocks.by_page("sh", ""))
def test_shell_lines(found, shell, request):
    if not any(re.search(r"motorlink sim .*:\./(st0|can0) .*&", block.text) for block in found):
        request.getfixturevalue("drives")
    for block in found:
        for line in lines(block.text):
            shell.run(*line)


@each_page(blocks.by_page("python", ""))
def test_python_blocks(found, folder, shell, drives, environment):
    # The guards, shares and nodes that the page starts, except those of a network with a router.
    for block in blocks.by_page("sh", "").get(found[0].page, ()):
        for line, words, code in lines(block.text):
            serves = words[0] == "motorlink" and words[1] in ("guard", "share", "node")
            if serves and words[-1] == "&" and "--network" not in words:
                shell.run(line, words, code)
    # With the line numbers of the page.
    program = ""
    for block in found:
        program += "\n" * (block.line - program.count("\n")) + block.text
    python(["-c", patient(simulated(program))], folder, environment)


@each(blocks.of("python", "pytest"))
def test_python_tests(block, folder, environment):
    (folder / "test_page.py").write_text(block.text)
    python(["-m", "pytest", "-q", "test_page.py"], folder, environment)


def patient(program):
    """The program with time for replies of simulated RMD motors on a busy machine."""
    return re.sub(r'rmd\.open\("[^"]+"(?!.*timeout)', r"\g<0>, timeout=1", program)


def python(arguments, folder, environment):
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment,
        capture_output=True, text=True, timeout=LIMIT,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@contextmanager
def alone(name):
    """Keeps out the other processes of this run."""
    folder = REPOSITORY / "target/pages"
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / name).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield folder


@pytest.fixture(scope="session")
def compiled_c(tmp_path_factory):
    """Compiles a program in C against the installed library; gives the path of the program."""
    with alone("c.lock") as pages:
        prefix = pages / "c"
        install = [REPOSITORY / "crates/ffi/packaging/install", prefix]
        subprocess.run(install, check=True, timeout=3600)
    folder = tmp_path_factory.mktemp("c")

    def compiled(block):
        source, program = folder / "page.c", folder / f"page{block.line}"
        source.write_text(simulated(block.text))
        subprocess.run(
            ["gcc", *STRICT, f"-I{prefix}/include", f"-I{REPOSITORY}/crates/ffi/examples",
             source, "-o", program, f"{prefix}/lib/libmotorlink.a", "-lm", "-lpthread", "-ldl"],
            check=True, timeout=LIMIT,
        )
        return program

    return compiled


@each(blocks.of("c", ""))
def test_programs_in_c(block, compiled_c, folder, drives, environment):
    runs(compiled_c(block), folder, environment)


def runs(program, folder, environment):
    done = subprocess.run(
        [program], cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT
    )
    assert done.returncode == 0, done.stdout + done.stderr


RUST = blocks.of("rust", "")
CRATES = {
    "motorlink": "motorlink",
    "motorlink-testbench": "testbench",
    "motorlink-proto": "proto",
    "motorlink-embedded": "embedded",
}
MANIFEST = """\
[workspace]
[package]
name = "pages"
version = "0.0.0"
edition = "2024"
[lints.rust]
warnings = "deny"
[dependencies]
signal-hook = "0.4"
"""


def rust_name(block):
    return f"{block.page.removesuffix('.md').replace('/', '_').lower()}_{block.line}"


@pytest.fixture(scope="session")
def compiled_rust():
    """Compiles all programs in Rust at once; gives the folder of the programs."""
    dependencies = "".join(
        f'{name} = {{ path = "{REPOSITORY}/crates/{folder}" }}\n' for name, folder in CRATES.items()
    )
    target = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target"))
    with alone("rust.lock") as pages:
        project = pages / "rust"
        shutil.rmtree(project, ignore_errors=True)
        (project / "src/bin").mkdir(parents=True)
        for block in RUST:
            (project / f"src/bin/{rust_name(block)}.rs").write_text(simulated(block.text))
        (project / "Cargo.toml").write_text(MANIFEST + dependencies)
        shutil.copy(REPOSITORY / "Cargo.lock", project)
        build = ["cargo", "build", "--quiet", "--bins", "--target-dir", target]
        subprocess.run(build, cwd=project, check=True, timeout=3600)
    return target / "debug"


@each(RUST)
def test_programs_in_rust(block, compiled_rust, folder, drives, environment):
    runs(compiled_rust / rust_name(block), folder, environment)


@each(blocks.of("toml", "fragment"))
def test_toml_fragments(block):
    tomllib.loads(block.text)


@each(blocks.of("toml", "scenario"))
def test_scenarios(block, shell):
    (shell.folder / "page.toml").write_text(block.text)
    shell.run(*next(lines("motorlink sim run page.toml")))


@each(blocks.of("toml", "config"))
def test_configurations(block, shell):
    (shell.folder / "page.toml").write_text(block.text)
    ports = [("st", "--st pty:./page-st"), ("rmd", "--rmd slcan-pty:./page-can")]
    served = " ".join(port for kind, port in ports if kind in tomllib.loads(block.text))
    shell.run(*next(lines(f"motorlink sim page.toml {served}")))


@pytest.fixture(scope="session")
def schema():
    return jsonschema.Draft202012Validator(
        json.loads((REPOSITORY / "docs/json.schema.json").read_text())
    )


@each(blocks.of("json", ""))
def test_json_lines(block, schema):
    for line in block.text.splitlines():
        schema.validate(json.loads(line))


@each(blocks.of("json", "any"))
def test_json(block):
    for line in block.text.splitlines():
        json.loads(line)
