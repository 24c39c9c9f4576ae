"""Parts of `make test` that cost much, and what they read.

While all of that is as it was when the part passed, `make test` does not run the part again.
tests/unchanged.json is the record. `make verify` and FORCE=1 run all parts.
"""

import functools
import hashlib
import json
import platform
import subprocess
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
RECORD = REPOSITORY / "tests/unchanged.json"
#: What every part reads.
COMMON = [
    ".cargo", "Cargo.lock", "Cargo.toml", "Makefile", "rust-toolchain.toml", "rustfmt.toml",
    "tests/install", "tests/parts.py", "tests/unchanged.py",
]
#: The packages that a part compiles, with all crates of this repository that they depend on; other paths.
PARTS = {
    "cost": (["motorlink-kernels"], []),
    "deny": ([], ["*Cargo.toml", "*Cargo.lock", "deny.toml", "tests/deny"]),
    "determinism": (["motorlink-sim"], []),
    "firmware-test": (
        ["motorlink-cli", "motorlink-embedded", "motorlink-ffi"],
        ["firmware", "tests/firmware", "tests/e2e", "scenarios"],
    ),
    "miri": (["motorlink-ffi", "motorlink-proto"], ["vectors"]),
    "probe": (
        ["motorlink-embedded", "motorlink-ffi", "motorlink-proto", "motorlink-sim"],
        ["docs/SIZES.md", "firmware", "probe"],
    ),
    "rustdoc": (["*"], ["README.md"]),
    "test-socketcan": (["motorlink-cli"], ["tests/socketcan"]),
}
#: What may be skipped in a run that is recorded: the list of vulnerabilities is not there everywhere.
MAY_SKIP = "SKIPPED: advisories"


def output(*command):
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return done.stdout


#: The same during a whole run: while a file that they come from is not committed, no state is known.
metadata = functools.cache(
    lambda: output("cargo", "metadata", "--format-version=1", "--no-deps", "--locked")
)
tools = functools.cache(lambda: output("rustc", "--version", "--verbose"))


def folders(packages):
    """The folders of packages and of all crates of this repository that they depend on."""
    found = {it["name"]: it for it in json.loads(metadata())["packages"]}
    wanted, folders = list(found) if packages == ["*"] else list(packages), set()
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
        paths = sorted({*COMMON, *paths, *(folders(packages) if packages else ())})
        if output("git", "status", "--porcelain", "--untracked-files=all", "--", *paths):
            return None
        files = output("git", "ls-files", "--stage", "--", *paths)
        # A release of Debian has one version of each other tool.
        system = Path("/etc/debian_version").read_text()
        parts = files, tools(), system, platform.python_version()
    except (OSError, subprocess.CalledProcessError):
        return None
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


class Unchanged:
    """The record, and what parts read now."""

    def __init__(self, parts):
        self.record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
        self.states = {part: state(part) for part in parts if part in PARTS}

    def entry(self, part):
        """The entry of a part that need not run: its revision, and what was skipped."""
        entry, now = self.record.get(part), self.states.get(part)
        return entry if entry and now and entry["state"] == now else None

    def passed(self, part, skipped):
        """Records that a part passed. What it reads may have changed meanwhile."""
        now = self.states.get(part)
        may = all(line.startswith(MAY_SKIP) for line in skipped)
        if now is None or self.entry(part) or not may or now != state(part):
            return
        revision = output("git", "rev-parse", "--short=8", "HEAD").strip()
        self.record[part] = {"revision": revision, "state": now, "skipped": skipped}
        RECORD.write_text(json.dumps(self.record, indent=1, sort_keys=True) + "\n")
