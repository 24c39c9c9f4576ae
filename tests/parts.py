#!/usr/bin/env python3
"""Runs parts of `make test`, two at a time, and prints the duration of each.

A part is a target of the Makefile. Its output goes to target/parts/PART.log and is printed when the
part fails. A line that begins with SKIPPED names a check that could not run here: those are printed at
the end. A part of --again that fails runs a second time, alone, when the others are over, with the
tests that failed where its runner can do that (AGAIN=1): if it passes then, a pause of the machine made
it fail, or a defect that is rare. It is reported as flaky, with the tests that failed. Parts that need not
run (unchanged.py) are named with the revision at which they passed.
"""

import argparse
import fcntl
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path

from unchanged import Unchanged

REPOSITORY = Path(__file__).resolve().parents[1]
LOGS = REPOSITORY / "target/parts"
#: A part that takes longer than this hangs, s.
LIMIT = 3600
#: How pytest, cargo and Playwright name a test that failed.
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S.*?)(?: - .*)?$|^test (\S+) .*\.\.\. FAILED$|^  +\d+\) (.+?)[ ─]*$", re.M)


def processor(output):
    """The seconds that `times` of the shell printed last, for what it has run."""
    times = re.findall(r"(?:\d+m[\d.]+s ?){2}\n", output)
    return sum(60 * int(m) + float(s) for m, s in re.findall(r"(\d+)m([\d.]+)s", "".join(times[-1:])))


class Run:
    """One run of a part."""

    def __init__(self, part, label, again=False):
        self.part, self.label = part, label
        if not again:
            shutil.rmtree(LOGS / f"{part}.cache", ignore_errors=True)
        self.log = LOGS / f"{label}.log"
        self.begun = time.monotonic()
        with self.log.open("wb") as output:
            self.process = subprocess.Popen(
                # `times` prints the processor time of all that it has run.
                ["sh", "-c", '"$@"; code=$?; times; exit $code', "sh", "make", "--no-print-directory", part]
                + (["AGAIN=1"] if again else []),
                cwd=REPOSITORY,
                # What cargo keeps for a next build costs a tenth of the first one.
                env={"CARGO_INCREMENTAL": "0", **os.environ},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def wait(self):
        try:
            self.passed, self.hung = self.process.wait(LIMIT) == 0, False
        except subprocess.TimeoutExpired:
            self.passed, self.hung = False, True
        self.end()
        self.seconds = time.monotonic() - self.begun
        self.output = self.log.read_text(errors="replace")
        if self.hung:
            self.output += f"\nended after {LIMIT} s"
        self.tests = sum(map(int, re.findall(r"\b(\d+) passed", self.output)))
        self.failed_tests = list(dict.fromkeys("".join(it) for it in FAILED.findall(self.output)))
        # As cargo says it.
        compiled = re.findall(r"^ *Finished .* in (?:(\d+)m )?([\d.]+)s$", self.output, re.M)
        self.compiled = sum(60 * int(m or 0) + float(s) for m, s in compiled)
        self.skipped = re.findall(r"^SKIPPED.*", self.output, re.M)
        self.processor = processor(self.output)

    def end(self):
        """Ends its processes."""
        for sign in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(self.process.pid, sign)
                self.process.wait(5)
            except ProcessLookupError:
                return
            except subprocess.TimeoutExpired:
                pass

    def __str__(self):
        verdict = "FAILED" if not self.passed else "skipped" if self.skipped else "passed"
        tests = f"{self.tests} tests" if self.tests else ""
        processor = f"{self.processor:.0f} s of processor"
        compiled = f"cargo compiled for {self.compiled:.0f} s" if self.compiled > 1 else ""
        return f"{self.label:18} {verdict:8} {self.seconds:5.0f} s  {processor:19}  {tests:11} {compiled}".rstrip()


class Runner:
    """Parts that wait, parts that run, and runs that are over."""

    def __init__(self, labels, unchanged):
        self.unchanged = unchanged
        self.waiting = deque(labels)
        self.count = len(self.waiting)
        self.running, self.over = set(), []
        self.lock = threading.Lock()
        self.stopped = False

    def work(self):
        while True:
            with self.lock:
                if self.stopped or not self.waiting:
                    return
                run = Run(*self.waiting.popleft())
                self.running.add(run)
            run.wait()
            with self.lock:
                self.running.remove(run)
                if self.stopped:
                    return
                self.over.append(run)
                if not run.passed:
                    print(f"\n---- {run.log}\n{run.output}\n----", flush=True)
                print(run, flush=True)

    def again(self, parts):
        """Runs a second time those of the parts that failed. Gives the first runs of those that pass now."""
        failed = [run for run in self.over if not (run.passed or run.hung) and run.part in parts]
        self.over = [run for run in self.over if run not in failed]
        others = len(self.over)
        self.waiting.extend((run.part, f"{run.label}-again", True) for run in failed)
        self.work()
        # The second run has a part of the tests only.
        for run, again in zip(failed, self.over[others:]):
            again.skipped = list(dict.fromkeys(run.skipped + again.skipped))
        return {run.part: run for run, again in zip(failed, self.over[others:]) if again.passed}

    def record(self, flaky):
        """Records the parts that came to their end; those that failed once did not pass."""
        for part in dict.fromkeys(run.part for run in self.over):
            runs = [run for run in self.over if run.part == part]
            self.unchanged.ran(part, part not in flaky and all(run.passed and not run.skipped for run in runs))

    def stop(self):
        with self.lock:
            self.stopped = True
            running = list(self.running)
        for run in running:
            run.end()


def load(count):
    """`count` processes that compute without end, at the priority of the tests."""
    subprocess.run([REPOSITORY / "tests/install", "stress-ng"], check=True)
    # They end with this process, even if it is killed.
    ending = ["setpriv", "--pdeathsig", "TERM"]
    return subprocess.Popen([*ending, "stress-ng", "--quiet", "--cpu", str(count)])


def number(text):
    if int(text) < 1:
        raise argparse.ArgumentTypeError("1 or more")
    return int(text)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("--jobs", type=number, default=2, help="parts at a time (default 2)")
    arguments.add_argument("--runs", type=number, default=1, help="runs of each part (default 1)")
    arguments.add_argument("--load", type=int, default=0, help="processes that compute beside them")
    arguments.add_argument("--strict", action="store_true", help="a skipped check is a failure")
    arguments.add_argument("--force", action="store_true", help="also parts that read nothing new")
    arguments.add_argument("--again", default="", help="parts that run again, alone, if they fail")
    arguments.add_argument("parts", nargs="+", metavar="PART")
    given = arguments.parse_args()
    parts = list(dict.fromkeys(given.parts))
    sys.stdout.reconfigure(errors="backslashreplace")

    LOGS.mkdir(parents=True, exist_ok=True)
    lock = (LOGS / "lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit(f"parts of this folder run already ({LOGS}): wait for their end")

    unchanged = Unchanged(parts)
    kept = {}
    if not given.force and given.runs == 1:
        kept = {part: entry for part in parts if (entry := unchanged.entry(part))}
        parts = [part for part in parts if part not in kept]
    for part, entry in kept.items():
        print(f"{part:18} unchanged since {entry['revision']}", flush=True)
    numbers = range(1, given.runs + 1)
    label = "{part}" if given.runs == 1 else "{part}-{run}"
    labels = ((part, label.format(part=part, run=run)) for run in numbers for part in parts)
    runner = Runner(labels, unchanged)
    workers = [threading.Thread(target=runner.work) for _ in range(given.jobs)]
    begun = time.monotonic()
    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, lambda sign, _: sys.exit(128 + sign))
    hogs = load(given.load) if given.load else None
    idle = False
    try:
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        flaky = runner.again(given.again.split())
        runner.record(flaky)
    finally:
        runner.stop()
        if hogs:
            idle = hogs.poll() is not None
            hogs.terminate()
            hogs.wait()

    for run in runner.over:
        for line in run.skipped:
            print(line)
    if idle:
        print("the load ended before the parts")
    skipped = sum(run.passed and bool(run.skipped) for run in runner.over)
    passed = sum(run.passed for run in runner.over) - skipped
    # What did not come to its end has failed.
    failed = runner.count - passed - skipped
    print(f"{time.monotonic() - begun:.0f} s in all; logs are in {LOGS.relative_to(REPOSITORY)}")
    tail = f", {skipped} skipped" if skipped else ""
    tail += f", {len(kept)} unchanged" if kept else ""
    print(f"{passed} passed, {failed} failed{tail}")
    for run in flaky.values():
        print(f"FLAKY: {run.part} failed, and passed when it ran again alone: see {run.log.relative_to(REPOSITORY)}")
        for test in run.failed_tests:
            print(f"FLAKY: {run.part}: {test}")
    sys.exit(bool(failed or not passed and not kept or idle or given.strict and skipped))


if __name__ == "__main__":
    main()
