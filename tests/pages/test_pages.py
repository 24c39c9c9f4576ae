"""Every code block of README.md and the pages runs: blocks.py says how."""

import json
import re
import subprocess
import sys
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


def test_every_block_names_its_language_and_its_check():
    for page in PAGES:
        found, indented = blocks.read(page)
        assert not indented, f"{page.name}: code without a fence in the lines {indented}"
        for block in found:
            assert block.word in WORDS.get(block.language, ()), (
                f"{block}: `{block.language} {block.word}` is not one of {WORDS}"
            )


#: Words that make a line quicker, and what it shows no other.
QUICKER = [
    (re.compile(r"(motorlink record .*--duration) \d+s"), r"\1 1s"),
    (re.compile(r"--count \d\d+"), "--count 3"),
    # Tests of tests/e2e run the whole kit.
    (re.compile(r"motorlink conformance (st|rmd) "), r"motorlink conformance \1 --only reply "),
    (re.compile(r"(?<=motorlink conformance host st) "), " --only acknowledge "),
    (re.compile(r"(?<=motorlink conformance host rmd) "), " --only an_e "),
]


def quicker(line):
    for slow, quick in QUICKER:
        line = slow.sub(quick, line)
    return line


@each_page(blocks.by_page("sh", ""))
def test_shell_lines(found, shell, request):
    if not any(re.search(r"motorlink sim .*:\./(st0|can0) .*&", block.text) for block in found):
        request.getfixturevalue("drives")
    for block in found:
        for line, words, code in lines(block.text):
            shell.run(quicker(line), words, code)


@each_page(blocks.by_page("python", ""))
def test_python_blocks(found, folder, shell, drives, environment):
    # The guards, shares and nodes that the page starts, except those of a network with a router.
    for block in blocks.by_page("sh", "").get(found[0].page, ()):
        for line, words, code in lines(block.text):
            serves = words[0] == "motorlink" and words[1] in ("guard", "share", "node")
            if serves and words[-1] == "&" and "--network" not in words:
                # A busy machine may be silent for longer than a guard of the page allows.
                shell.run(re.sub(r"--silence \S+", "--silence 10s", line), words, code)
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


def libraries(*words):
    """What cargo builds with these words, by the names of the libraries."""
    build = ["cargo", *words, "--locked", "--message-format=json"]
    done = subprocess.run(build, cwd=REPOSITORY, check=True, stdout=subprocess.PIPE, text=True, timeout=3600)
    built = [it for it in map(json.loads, done.stdout.splitlines()) if it["reason"] == "compiler-artifact"]
    return {
        it["target"]["name"]: file for it in built for file in it["filenames"] if file.endswith((".rlib", ".a"))
    }


def compiled(source, block, command, libraries=()):
    """Compiles a program without a warning; gives its path."""
    source.write_text(simulated(block.text))
    program = source.with_suffix("")
    subprocess.run([*command, source, "-o", program, *libraries], check=True, timeout=LIMIT)
    return program


def runs(block, program, folder, environment):
    done = subprocess.run(
        [program], cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT
    )
    assert done.returncode == 0, f"{block}: {done.stdout}{done.stderr}"


def test_programs_in_c(tmp_path, folder, drives, environment):
    built = libraries("rustc", "--package=motorlink-ffi", "--lib", "--features=std", "--crate-type=staticlib")
    ffi = REPOSITORY / "crates/ffi"
    for block in blocks.of("c", ""):
        command = ["gcc", *STRICT, f"-I{ffi}/include", f"-I{ffi}/examples"]
        library = [built["motorlink_ffi"], "-lm", "-lpthread", "-ldl"]
        program = compiled(tmp_path / f"c{block.line}.c", block, command, library)
        runs(block, program, folder, environment)


def test_programs_in_rust(tmp_path, folder, drives, environment):
    # Those of the program, which other parts need, too.
    built = libraries("build", "--workspace", "--all-features", "--bin=motorlink")
    command = ["rustc", "--edition=2024", "-Dwarnings", f"-Ldependency={Path(built['signal_hook']).parent}"]
    for name in ("motorlink", "motorlink_proto", "motorlink_testbench", "signal_hook"):
        command.append(f"--extern={name}={built[name]}")
    for block in blocks.of("rust", ""):
        program = compiled(tmp_path / f"rust{block.line}.rs", block, command)
        runs(block, program, folder, environment)


def test_toml_fragments():
    for block in blocks.of("toml", "fragment"):
        check(block, tomllib.loads, block.text)


def check(block, parse, text):
    """Fails with the place of the block."""
    try:
        parse(text)
    except ValueError as error:
        pytest.fail(f"{block}: {error}: {text}")


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


def test_json():
    for block in blocks.of("json", "", "any"):
        for line in block.text.splitlines():
            check(block, json.loads, line)


def test_json_lines():
    schema = jsonschema.Draft202012Validator(json.loads((REPOSITORY / "docs/json.schema.json").read_text()))
    wrong = [
        f"{block}: {error.message}"
        for block in blocks.of("json", "")
        for line in block.text.splitlines()
        for error in schema.iter_errors(json.loads(line))
    ]
    assert wrong == []

