"""The README's Python lines, as printed, beside the drives that its shell lines serve."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from conftest import PATIENT, REPOSITORY, Served

#: A simulator answers, in a process of its own: a busy machine delays it.
PREPARED = f"""\
import inspect, motorlink
for protocol in motorlink.st, motorlink.rmd:
    inspect.unwrap(protocol.open).__kwdefaults__["timeout"] = {PATIENT}
"""


def test_the_lines_of_the_readme_run_as_printed(
    command: str, served: Served, tmp_path: Path
) -> None:
    section = (REPOSITORY / "README.md").read_text().split("\n## Python\n")[1].split("\n## ")[0]
    blocks = re.findall(r"^```python\n(.*?)^```", section, re.S | re.M)
    assert blocks
    path = f"{Path(command).parent}:{os.environ['PATH']}"
    for block in blocks:
        done = subprocess.run(
            [sys.executable, "-c", PREPARED + block],
            cwd=tmp_path,
            env={**os.environ, "PATH": path},
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 0, done.stderr
