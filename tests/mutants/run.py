#!/usr/bin/env python3
"""Mutation testing: which single faults in the code no test notices (docs/CHECKS.md).

The mutants in Rust are a sample of those that cargo-mutants makes, drawn with a seed. All of them are in one
build: schemata.py says how. One run of all tests shows which test reaches which mutant, and a mutant is tested
by those only, the cheapest first. Those of by_hand.toml, which people made in Python and in the page, are made one
after the other. A test notices a mutant if it fails twice with it. results.json has the test that noticed each
mutant, "" if none did, as soon as that is known: so an interrupted run can be continued.
"""

import argparse
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import schemata

REPOSITORY = Path(__file__).resolve().parents[2]
RECORD = REPOSITORY / "tests/mutants/results.json"
TREE = REPOSITORY / "target/mutants/tree"
REACHED = REPOSITORY / "target/mutants/reached"
#: Their tests measure, fuzz, or read the source.
NO_TESTS_OF_BEHAVIOUR = {"structure", "fuzz", "bench", "kernels", "reliability"}
#: A command that takes longer hangs, s.
LIMIT = 1200
PYTEST = "-m pytest -q -p no:cacheprovider -n 4 --dist worksteal"
PYTHON_TESTS = f"cd bindings/python/tests && ../../../.venv/bin/python {PYTEST}"


def run(command, limit=LIMIT, **variables):
    """Whether a shell command in the tree passes, and what it prints."""
    environment = {**os.environ, "CARGO_PROFILE_DEV_DEBUG": "0", "RUST_TEST_THREADS": "16", **variables}
    process = subprocess.Popen(
        command, shell=True, cwd=TREE, env=environment, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
    )  # fmt: skip
    try:
        text = process.communicate(timeout=limit)[0]
    except subprocess.TimeoutExpired:
        text = f"no end in {limit:.0f} s"
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    return process.returncode == 0, text


def must(command, **variables):
    passed, text = run(command, 3600, **variables)
    if not passed:
        sys.exit(f"{command}\n{text[-4000:]}")
    return text


class Program:
    """A test program of cargo."""

    def __init__(self, message):
        package = re.search(r"(?:#|/)(motorlink[\w-]*)(?:@|#|$)", message["package_id"])[1]
        self.package = package.removeprefix("motorlink-")
        self.name = f"{self.package} {message['target']['name']}"
        self.path = message["executable"]
        self.folder = Path(message["manifest_path"]).parent

    def run(self, limit=LIMIT, tests="", **variables):
        return run(f"cd {self.folder} && {self.path} {tests}", limit, CARGO_MANIFEST_DIR=str(self.folder), **variables)

    def notices(self, mutant, limit):
        passed, text = self.run(limit, MUTANT=mutant)
        if passed:
            return False
        failed = re.findall(r"^    (\S+)$", text.rpartition("\nfailures:\n")[2], re.M)
        return not self.run(limit, f"--exact {' '.join(failed)}", MUTANT=mutant)[0]


def programs():
    text = must("cargo test --workspace --all-features --locked --lib --bins --tests --no-run --message-format=json 2>&1")
    messages = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
    tests = [it for it in messages if it.get("executable") and it.get("profile", {}).get("test")]
    found = map(Program, tests)
    return [it for it in found if it.package not in NO_TESTS_OF_BEHAVIOUR]


class Tests:
    """All tests, and which of them reach a mutant."""

    def __init__(self, mutants):
        must("cargo build --workspace --all-features --bin motorlink --example machine --example rmd_frames "
             "--example wireshark_frames --locked")  # fmt: skip
        self.programs = programs()
        must("make package")
        self.end_to_end = f"cd tests/e2e && MOTORLINK_BIN={TREE}/target/debug/motorlink ../../.venv/bin/python {PYTEST} -p no:motorlink"
        self.turn = threading.Lock()
        of_tests = schemata.output("git", "rev-parse", "HEAD:crates", "HEAD:bindings", "HEAD:tests/e2e", cwd=TREE)
        of, known = [*of_tests.split(), *(it["name"] for it in mutants)], {}
        if REACHED.with_suffix(".json").exists():
            known = json.loads(REACHED.with_suffix(".json").read_text())
        if known.get("of") != of:
            known = {"of": of, "seconds": {}, "reached": {}}
        self.trace(known)
        self.seconds = known["seconds"]
        self.reached = {int(number): sorted(set(tests)) for number, tests in known["reached"].items()}

    def trace(self, known):
        """Runs once, without a mutant, the tests that are not known yet."""
        for name, test in [
            *((it.name, it.run) for it in self.programs),
            ("e2e", lambda **variables: run(self.end_to_end, 3600, **variables)),
            ("python", lambda **variables: run(PYTHON_TESTS, 3600, **variables)),
        ]:
            if name in known["seconds"]:
                continue
            folder = REACHED / name.replace(" ", "-")
            folder.mkdir(parents=True, exist_ok=True)
            begun = time.monotonic()
            passed, text = test(MUTANTS_REACHED=str(folder))
            known["seconds"][name] = time.monotonic() - begun
            print(f"{name}: {known['seconds'][name]:.0f} s{'' if passed else ', FAILED without a mutant'}", flush=True)
            if not passed:
                print(text[-1500:], flush=True)
            for file in folder.iterdir():
                for line in file.read_text().splitlines():
                    number, _, of_pytest = line.partition(" ")
                    of_pytest = of_pytest.rpartition(" (")[0].removeprefix("tests/e2e/")
                    label = f"e2e {of_pytest}" if name == "e2e" else name
                    if of_pytest or name != "e2e":
                        known["reached"].setdefault(number, []).append(label)
                file.unlink()
            REACHED.with_suffix(".json").write_text(json.dumps(known))

    def notice(self, number, package):
        """The test that notices a mutant; "" if none does."""
        reached = self.reached.get(number, [])
        mine = [it for it in self.programs if it.name in reached]
        for program in sorted(mine, key=lambda it: (it.package != package, self.seconds[it.name])):
            if program.notices(str(number), 60 + 5 * self.seconds[program.name]):
                return program.name
        # Of a resource that many tests share, only the first one is known to reach the mutant.
        tests = [it.removeprefix("e2e ") for it in reached if it.startswith("e2e ")]
        # Two of these at once would be late.
        with self.turn:
            for chosen in (tests, sorted({it.partition("::")[0] for it in tests})):
                if chosen and (test := noticed(self.end_to_end, chosen, MUTANT=str(number))):
                    return f"e2e {test}"
            if "python" in reached and (test := noticed(PYTHON_TESTS, [], MUTANT=str(number))):
                return f"python {test}"
        return ""


def noticed(command, tests, **variables):
    """The first of the tests of pytest that fails twice."""
    arguments = TREE.parent / "tests.txt"
    # Another one that fails by chance hides those behind it.
    for _ in range(3):
        arguments.write_text("\n".join(tests))
        passed, text = run(f"{command} -x -rfE @{arguments}", **variables)
        failed = re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", text, re.M)[:4]
        for test in failed:
            arguments.write_text(test)
            if not run(f"{command} @{arguments}", **variables)[0]:
                return test
        if passed:
            break
        if not failed:
            return "no end" if text.startswith("no end") else sys.exit(f"{command}\n{text[-1000:]}")
    return None


def by_hand(mutant):
    """What notices a mutant of by_hand.toml: in the page, or in the package where it is installed for its tests."""
    path = TREE / mutant["file"]
    is_page = mutant["file"].startswith("web/")
    if not is_page:
        path = next(TREE.glob(f".venv/lib/*/site-packages/motorlink/{path.name}"))
        # Or `make package` would keep it if this process is killed.
        (TREE / ".venv/motorlink.whl").unlink(missing_ok=True)
    text = path.read_text()
    if text.count(mutant["find"]) != 1:
        sys.exit(f"{mutant['name']}: {path} does not have the text of `find` exactly once")
    path.write_text(text.replace(mutant["find"], mutant["replace"]))
    try:
        if not is_page:
            return (test := noticed(PYTHON_TESTS, [])) and f"python {test}" or ""
        for command in ("make web-test", "make browser T=-x"):
            if not run(command)[0] and not run(f"{command} AGAIN=1")[0]:
                return command
        return ""
    finally:
        path.write_text(text)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--count", type=int, default=120)
    arguments.add_argument("--again", action="store_true", help="also mutants that have a result")
    given = arguments.parse_args()
    schemata.checkout(REPOSITORY, TREE)
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    drawn = record.setdefault(f"seed {given.seed}", {})
    of_people = record.setdefault("by hand", {})
    before = {**drawn, **of_people}
    made = tomllib.loads((REPOSITORY / "tests/mutants/by_hand.toml").read_text())["mutant"]
    lock = threading.Lock()

    def tell(results, name, noticed):
        with lock:
            results[name] = noticed
            RECORD.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
            print(f"{name}\n    -> {noticed!r}", flush=True)

    if given.again or not drawn or None in drawn.values():
        mutants = schemata.sample(TREE, given.seed, given.count, list(drawn))
        # Without those whose code is gone.
        drawn = record[f"seed {given.seed}"] = {it["name"]: drawn.get(it["name"]) for it in mutants}
        tests = Tests(mutants)
        todo = [(number, it) for number, it in enumerate(mutants, 1) if given.again or drawn[it["name"]] is None]
        # Most tests wait.
        with ThreadPoolExecutor(2) as workers:
            list(workers.map(lambda it: tell(drawn, it[1]["name"], tests.notice(it[0], it[1]["package"])), todo))
    schemata.restore(TREE)
    made = [it for it in made if given.again or it["name"] not in of_people]
    if made:
        must("make package")
    for mutant in made:
        tell(of_people, mutant["name"], by_hand(mutant))
    results = {**drawn, **of_people}
    for name in (missed := [name for name, noticed in results.items() if not noticed]):
        print(f"NOT NOTICED: {name}")
    levels = Counter(noticed.partition(" ")[0] or "none" for noticed in results.values())
    print(f"seed {given.seed}: {len(results) - len(missed)} of {len(results)} are noticed; by {dict(levels)}")
    if lost := [name for name in missed if before.get(name)]:
        sys.exit("\n".join(["noticed before, and no more:", *lost]))


if __name__ == "__main__":
    main()
