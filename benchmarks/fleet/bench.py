"""What the measurements of fleets have in common: programs, their CPU time, tables in the docs."""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests/e2e"))

#: The program that is measured.
MOTORLINK = os.environ.get("MOTORLINK_BIN", ROOT / "target/dist/motorlink")
TICK = os.sysconf("SC_CLK_TCK")


class Program:
    """A program, and the JSON lines that it prints."""

    def __init__(self, *words, network=None):
        environment = {k: v for k, v in os.environ.items() if not k.startswith("MOTORLINK_")}
        if network:
            environment["MOTORLINK_NETWORK"] = network
        self.errors = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(
            [MOTORLINK, *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=self.errors,
            text=True,
            env=environment,
        )
        self.pid = self.process.pid

    def line(self):
        """The next line."""
        line = self.process.stdout.readline()
        if not line:
            self.errors.seek(0)
            raise RuntimeError(f"{self.process.args} has ended: {self.errors.read()}")
        return json.loads(line)

    def cpu(self):
        """The CPU time that it took, in seconds."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / TICK

    def send(self, number):
        os.kill(self.pid, number)

    def wait(self, within=60):
        rest = self.process.communicate(timeout=within)[0]
        return [json.loads(line) for line in rest.splitlines()]

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.errors.close()


class Bench(ExitStack):
    """Programs and a folder, until the end of a measurement."""

    def __enter__(self):
        super().__enter__()
        self.folder = Path(self.enter_context(tempfile.TemporaryDirectory(prefix="motorlink-fleet-")))
        return self

    def start(self, *words, **options):
        program = Program(*words, **options)
        self.callback(program.end)
        return program


def until(condition, what, within=30.0, pause=0.005):
    """Waits until `condition` is true; gives the time that it took."""
    began = time.monotonic()
    while not condition():
        if time.monotonic() > began + within:
            raise TimeoutError(what)
        time.sleep(pause)
    return time.monotonic() - began


def percentile(values, part):
    """The value below which this part of the values is."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def table(heads, rows):
    """A table in Markdown, numbers to the right."""
    lines = [heads, ["--" if at == 0 else "--:" for at in range(len(heads))], *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def publish(name, text):
    """Prints a table. With MOTORLINK_UPDATE_DOCS=1 it also goes into docs/BENCHMARKS.md."""
    print(f"\n{text}\n", flush=True)
    if os.environ.get("MOTORLINK_UPDATE_DOCS") != "1":
        return
    page = ROOT / "docs/BENCHMARKS.md"
    between = re.compile(f"(<!-- {name} -->\n).*?(\n<!-- end of {name} -->)", re.DOTALL)
    old = page.read_text()
    assert between.search(old), f"{page} has no place for {name}"
    page.write_text(between.sub(lambda found: f"{found[1]}\n{text}\n{found[2]}", old))
