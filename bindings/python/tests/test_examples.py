"""The examples run unchanged, without hardware and without a screen."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(folder: Path, *words: str) -> str:
    """The output of an example."""
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_every_example_has_a_test() -> None:
    known = {"first_steps.py", "pi_tuning.py", "torque_loop.py", "test_bench.py"}
    assert {path.name for path in EXAMPLES.glob("*.py")} == known
    for path in EXAMPLES.glob("*.py"):
        assert "\n# %%" in path.read_text(), f"{path.name} has no cells"


def test_first_steps(tmp_path: Path) -> None:
    told = run(tmp_path, str(EXAMPLES / "first_steps.py"))
    assert "status   RUN\n" in told
    assert "refused  SET_READ_ONLY\n" in told
    assert re.search(r"angle +(89\.\d|90\.\d) degrees", told)


def test_pi_tuning_finds_better_gains_and_draws_them_where_matplotlib_is_installed(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="the extra `plot` is not installed")
    (tmp_path / "run.py").write_text(
        "import runpy, sys\n"
        "sys.modules['matplotlib'] = None\n"
        f"found = runpy.run_path({str(EXAMPLES / 'pi_tuning.py')!r})\n"
        "del sys.modules['matplotlib']\n"
        "found['draw']('tuned.svg')\n"
    )
    told = run(tmp_path, "run.py")
    errors = [int(row) for row in re.findall(r"(\d+) rpm +[\d.]+ A$", told, re.MULTILINE)]
    assert len(errors) == 2
    assert errors[1] < 0.8 * errors[0]
    assert "pip install matplotlib" in told
    assert ElementTree.parse(tmp_path / "tuned.svg").getroot().tag.endswith("svg")


def test_torque_loop(tmp_path: Path) -> None:
    told = run(tmp_path, str(EXAMPLES / "torque_loop.py"))
    assert "1000 Hz, 0 replies lost" in told
    rows = re.findall(r"rms: +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+) ", told)
    undisturbed, pushed, end = ([float(value) for value in row] for row in rows)
    assert max(undisturbed) < 2
    assert pushed[2] > 5 > pushed[3]
    assert max(end) < 2


def test_the_test_bench(tmp_path: Path) -> None:
    told = run(
        tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(EXAMPLES / "test_bench.py")
    )
    assert re.search(r"^6 passed", told, re.MULTILINE), told
