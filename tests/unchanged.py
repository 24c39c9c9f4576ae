"""Parts of `make test`, and what they read.

While all of that is as it was when the part passed, `make test` does not run the part again.
tests/unchanged.json is the record. `make verify` and FORCE=1 run all parts. Security updates change
tools without a trace here; so the public CI runs all parts each night.
"""

import functools
import hashlib
import json
import os
import platform
import subprocess
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
RECORD = REPOSITORY / "tests/unchanged.json"
#: What every part reads: files in the root but pages, all features and versions of packages.
COMMON = [
    ":(glob)*", ":(exclude,glob)*.md", "*Cargo.toml", "*Cargo.lock", ".cargo", "*.gitattributes",
    "tests/install", "tests/parts.py", "tests/unchanged.py",
]
#: What firmware-test takes from the tests of the program.
OF_E2E = [f"tests/e2e/{it}.py" for it in ("conftest", "program", "st_wire", "test_rmd_can", "test_st_bytes")]
#: What crates/ffi/packaging installs.
INSTALLED = ["docs/C.md", "docs/SIZES.md", "docs/SPEC-NOTES.md"]
#: The packages that a part tests, with all crates of this repository that they depend on; other paths. The
#: command line counts only where it is tested: in unit, e2e and pages, which always run.
PARTS = {
    "browser": (["motorlink-monitor"], ["crates/cli/src/monitor", "crates/cli/src/share", "crates/cli/src/sim", "web"]),
    "cost": (["motorlink-kernels"], []),
    "determinism": (["motorlink-kernels"], []),
    "ffi-test": (["motorlink-conformance", "motorlink-ffi"], ["vectors", *INSTALLED]),
    "firmware-test": (
        ["motorlink-conformance", "motorlink-embedded", "motorlink-ffi"],
        ["firmware", ":(glob)tests/*.py", "tests/requirements.txt", "tests/firmware", *OF_E2E, *INSTALLED],
    ),
    "probe": (
        ["motorlink-embedded", "motorlink-ffi", "motorlink-proto", "motorlink-sim"],
        ["firmware", "probe", *INSTALLED],
    ),
    "python": (
        ["motorlink-fleet", "motorlink-recording", "motorlink-testbench"],
        ["bindings/python", "tests/measured.py", "tests/requirements.txt", "tests/e2e/recordings.py", "docs/PYTHON.md",
         "scenarios", "vectors"],
    ),
    "test-socketcan": (["motorlink-telemetry"], ["tests/socketcan"]),
    "web-test": ([], ["web"]),
}
#: Variables that change what is built or tested, but for those that say where things are or what is printed.
OF_BUILDS = ("CARGO", "RUST", "MIRI", "VALGRIND", "PROPTEST", "GLIBC")
HARMLESS = (
    "CARGO_HOME", "CARGO_TARGET_DIR", "CARGO_TERM", "RUSTUP_", "RUST_BACKTRACE", "RUST_LOG", "RUST_TEST_THREADS",
)  # fmt: skip
#: Variables of make that choose parts.
OF_CHOICE = ("PARTS=", "FORCE=", "STRICT=", "ONCE=", "LONG=")


def output(*command):
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout


def settings():
    """What was set in the environment, for make, and for cargo outside of this folder."""
    set_here = [f"{name}={value}" for name, value in os.environ.items() if name.startswith(OF_BUILDS)]
    given = os.environ.get("MAKEFLAGS", "").partition("-- ")[2].split()
    homes = [Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))]
    homes += [folder / ".cargo" for folder in REPOSITORY.parents]
    files = [home / name for home in homes for name in ("config", "config.toml")]
    return sorted(
        [it for it in set_here if not it.startswith(HARMLESS)]
        + [it for it in given if not it.startswith(OF_CHOICE)]
        + [file.read_text() for file in files if file.exists()]
    )


# The same during a whole run: while a file that they come from is not committed, no state is known.
@functools.cache
def crates():
    found = json.loads(output("cargo", "metadata", "--format-version=1", "--no-deps", "--locked"))
    return {it["name"]: it for it in found["packages"]}


@functools.cache
def tools():
    # A release of Debian has about one version of each other tool.
    system = Path("/etc/debian_version").read_text()
    return [output("rustc", "--version", "--verbose"), system, platform.python_version()]


def folders(packages):
    """The folders of packages and of all crates of this repository that they depend on."""
    found = crates()
    wanted, folders = list(packages), set()
    while wanted:
        package = found[wanted.pop()]
        folder = str(Path(package["manifest_path"]).parent.relative_to(REPOSITORY))
        if folder not in folders:
            folders.add(folder)
            wanted += [it["name"] for it in package["dependencies"] if it["name"] in found]
    return folders


def state(part):
    """What a part reads, as one number, and the tools. None: it is not known, or not committed."""
    packages, paths = PARTS[part]
    try:
        paths = [*COMMON, *paths, *sorted(folders(packages) if packages else ())]
        if output("git", "status", "--porcelain", "--untracked-files=all", "--", *paths):
            return None
        files = output("git", "ls-files", "--stage", "--", *paths)
        parts = files, *tools(), *settings()
    except (OSError, subprocess.CalledProcessError):
        return None
    return hashlib.sha256("\0".join(parts).encode()).hexdigest() if files else None


class Unchanged:
    """The record, and what parts read now."""

    def __init__(self, parts):
        try:
            self.record = dict(json.loads(RECORD.read_text()))
        except FileNotFoundError:
            self.record = {}
        except ValueError as error:
            print(f"{RECORD} cannot be read, so all parts run: {error}")
            self.record = {}
        self.states = {part: state(part) for part in parts if part in PARTS}

    def entry(self, part):
        """The entry of a part that need not run: its revision."""
        entry, now = self.record.get(part), self.states.get(part)
        return entry if entry and now and entry["state"] == now else None

    def ran(self, part, passed):
        """Records whether a part passed without skips. What it reads may have changed meanwhile."""
        now = self.states.get(part)
        if now is None or now != state(part):
            return
        was = self.record.pop(part, None)
        if passed:
            revision = output("git", "rev-parse", "--short=8", "HEAD").strip()
            # The revision stays the first one.
            is_same = was and was["state"] == now
            self.record[part] = was if is_same else {"revision": revision, "state": now}
        whole = RECORD.with_suffix(".new")
        whole.write_text(json.dumps(self.record, indent=1, sort_keys=True) + "\n")
        whole.replace(RECORD)
