#!/usr/bin/env python3
"""Mutation testing: which single faults in the code no test notices (docs/CHECKS.md).

The mutants are a sample of those that cargo-mutants makes, drawn with a seed, and those of
tests/mutants/by_hand.toml, which people made in Python and in the page. The tests run in levels, the cheapest
first, until one notices the mutant: it fails twice with it. tests/mutants/results.json has the result of each
mutant as soon as it is known, so a run that was ended goes on where it was. A mutant that has a result
is tested again with AGAIN: first with the command that noticed it.
"""

import argparse
import json
import os
import random
import re
import signal
import subprocess
import tomllib
from collections import Counter
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
RECORD = REPOSITORY / "tests/mutants/results.json"
CRATES = ["proto", "motorlink", "link", "telemetry", "recording", "capture", "cli", "fleet", "monitor"]
#: Their tests measure, fuzz, or read the source.
NO_TESTS_OF_BEHAVIOUR = {"structure", "fuzz", "bench", "kernels", "reliability", "python"}
#: A command that takes longer hangs, s.
LIMIT = 900


def output(*command, cwd=REPOSITORY):
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=True).stdout


class Tree:
    """The committed files once more, with a build of their own."""

    def __init__(self):
        self.path = REPOSITORY / "target/mutants/tree"
        if not self.path.exists():
            output("git", "clone", "--quiet", "--shared", str(REPOSITORY), str(self.path))
        output("git", "fetch", "--quiet", "origin", cwd=self.path)
        head = output("git", "rev-parse", "HEAD").strip()
        output("git", "checkout", "--quiet", "--force", "--detach", head, cwd=self.path)
        self.environment = {
            **os.environ,
            "CARGO_PROFILE_DEV_DEBUG": "0",
            "CARGO_INCREMENTAL": "1",
            "RUST_TEST_THREADS": "16",
        }

    def passes(self, command):
        """Whether a shell command passes, and what it prints."""
        print(f"    {command}", flush=True)
        process = subprocess.Popen(
            command, shell=True, cwd=self.path, env=self.environment, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        )  # fmt: skip
        try:
            text = process.communicate(timeout=LIMIT)[0]
        except subprocess.TimeoutExpired:
            text = f"no end in {LIMIT} s"
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.communicate()
        return process.returncode == 0, text

    def restore(self):
        output("git", "checkout", "--quiet", "--force", "--", ".", cwd=self.path)


def of_cargo(seed, count):
    """A sample: name and how to make the mutant."""
    crates = [argument for crate in CRATES for argument in ("--file", f"crates/{crate}/src/**/*.rs")]
    listed = json.loads(output("cargo", "mutants", "--list", "--json", "--diff", *crates))
    # Names with the same text have a number: lines change with each commit.
    seen, mutants = Counter(), []
    for it in listed:
        name = re.sub(r":\d+:\d+:", ":", it["name"])
        seen[name] += 1
        mutants.append({**it, "name": f"{name} #{seen[name]}"})
    return random.Random(seed).sample(mutants, count)


def dependents():
    """For each package of the workspace those that depend on it, the nearest first."""
    found = json.loads(output("cargo", "metadata", "--format-version=1", "--no-deps", "--locked"))["packages"]
    direct = {it["name"]: {dependency["name"] for dependency in it["dependencies"]} for it in found}
    names = [name for name in direct if name.removeprefix("motorlink-") not in NO_TESTS_OF_BEHAVIOUR]
    above = {}
    for package in direct:
        above[package], reached = [], {package}
        while more := [it for it in names if it not in reached and direct[it] & reached]:
            above[package] += more
            reached |= set(more)
    return above


def test(*packages):
    return "cargo test --locked --quiet --all-features " + " ".join(f"-p {it}" for it in packages)


def levels(mutant, above):
    """Commands that test it. They are not run if the crate does not compile."""
    if package := mutant.get("package"):
        yield test(package) + " --lib --bins --tests"
        if above[package]:
            yield test(*above[package]) + " --lib --bins --tests"
        yield "make e2e T=-x"
        yield "make python T=-x"
    elif mutant["file"].startswith("web/"):
        yield "make web-test"
        yield "make browser"
    else:
        yield "make python T=-x"
        yield "make e2e T=-x"


def second(command, text):
    """The tests again that failed."""
    if command.startswith("make"):
        return f"{command} AGAIN=1"
    target = re.search(r"to rerun pass `(.*)`", text)
    failed = re.findall(r"^    (\S+)$", text.rpartition("\nfailures:\n")[2], re.M)
    return f"cargo test --locked --quiet --all-features {target[1]} -- --exact {' '.join(failed)}" if target else command


def make(tree, mutant):
    """Changes the file."""
    path = tree.path / mutant["file"]
    if "diff" in mutant:
        subprocess.run(["patch", "--quiet", str(path)], input=mutant["diff"], text=True, check=True)
        return
    text = path.read_text()
    if text.count(mutant["find"]) != 1:
        raise SystemExit(f"{mutant['name']}: {mutant['file']} does not have the text of `find` exactly once")
    path.write_text(text.replace(mutant["find"], mutant["replace"]))


def noticed(tree, mutant, above, before):
    """The command that notices the mutant, "" for none, None if it does not compile."""
    make(tree, mutant)
    if package := mutant.get("package"):
        if not tree.passes(f"cargo build --locked --quiet --all-features -p {package}")[0]:
            return None
    commands = [it for it in (before,) if it] + list(levels(mutant, above))
    for command in commands:
        passed, text = tree.passes(command)
        if passed:
            continue
        if text.startswith("no end"):
            return command
        again = second(command, text)
        if not tree.passes(again)[0]:
            return again if again.startswith("cargo") else command
    return ""


def main():
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--count", type=int, default=120)
    arguments.add_argument("--again", action="store_true", help="also mutants that have a result")
    given = arguments.parse_args()
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    by_hand = tomllib.loads((REPOSITORY / "tests/mutants/by_hand.toml").read_text())["mutant"]
    mutants = by_hand + of_cargo(given.seed, given.count)
    above = dependents()
    tree = Tree()
    lost = []
    for number, mutant in enumerate(mutants, 1):
        name = mutant["name"]
        before = record.get(name)
        if name in record and not given.again:
            continue
        print(f"{number} of {len(mutants)}: {name}", flush=True)
        try:
            record[name] = noticed(tree, mutant, above, before)
        finally:
            tree.restore()
        print(f"    -> {record[name]!r}", flush=True)
        if before and not record[name]:
            lost.append(name)
        RECORD.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
    results = [record[it["name"]] for it in mutants]
    missed = [it["name"] for it in mutants if record[it["name"]] == ""]
    for name in missed:
        print(f"NOT NOTICED: {name}")
    compiled = [it for it in results if it is not None]
    print(f"seed {given.seed}: {len(compiled)} mutants compile, {len(compiled) - len(missed)} of them are noticed")
    if lost:
        raise SystemExit("\n".join(["noticed before, and no more:", *lost]))


if __name__ == "__main__":
    main()
