"""The program, the package and the C library, as the reader of a page has them. `make pages` builds them."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from blocks import REPOSITORY
from shell import Shell

#: What a page's lines find in the current folder, as in a clone.
FOLDERS = ["bindings", "contrib", "crates", "docs", "scenarios", "tests", "vectors"]
SERVE = "motorlink sim --st pty:./st0 --rmd slcan-pty:./can0"


@pytest.fixture(scope="session")
def environment():
    """The environment of a reader: `motorlink` and `python3` are those of the package."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("MOTORLINK_")}
    path = f"{Path(sys.executable).parent}:{inherited['PATH']}"
    return {**inherited, "PATH": path, "NO_COLOR": "1", "MPLBACKEND": "Agg"}


@pytest.fixture
def folder(tmp_path):
    """A folder like a clone, in which lines may write files."""
    for name in FOLDERS:
        (tmp_path / name).symlink_to(REPOSITORY / name)
    shutil.copy(REPOSITORY / "tests/e2e/hosts/careful_st.py", tmp_path / "my_host.py")
    return tmp_path


@pytest.fixture
def shell(folder, environment):
    """A shell in that folder."""
    with Shell(folder, environment) as shell:
        yield shell


@pytest.fixture
def drives(shell):
    """Simulated drives at ./st0 and ./can0 of that folder."""
    shell.run(f"{SERVE} &", [*SERVE.split(), "&"], 0)
