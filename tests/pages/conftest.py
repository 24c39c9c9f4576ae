"""The program, the package and the C library, as the reader of a page has them. `make pages` builds them."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from blocks import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "tests/e2e"))

from program import environment as without_settings  # noqa: E402
from shell import Shell, free_port  # noqa: E402

#: What a page's lines find in the current folder, as in a clone.
FOLDERS = ["bindings", "contrib", "crates", "docs", "scenarios", "tests", "vectors"]
SERVE = "motorlink sim --st pty:./st0 --rmd slcan-pty:./can0"


#: What a reader's commands have: `motorlink` and `python3` are those of the package. A busy machine may
#: be late with a reply of a simulated motor.
VARIABLES = {
    "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    "MPLBACKEND": "Agg",
    "MOTORLINK_RMD_TIMEOUT": "1s",
    # That of the shell lines of a page is also that of its Python.
    "MOTORLINK_NETWORK": f"tcp/127.0.0.1:{free_port()}",
}


@pytest.fixture(scope="session")
def environment():
    """The environment of a reader."""
    return without_settings(VARIABLES)


@pytest.fixture
def folder(tmp_path):
    """A folder like a clone, in which lines may write files."""
    for name in FOLDERS:
        (tmp_path / name).symlink_to(REPOSITORY / name)
    shutil.copy(REPOSITORY / "tests/e2e/hosts/careful_st.py", tmp_path / "my_host.py")
    return tmp_path


@pytest.fixture
def shell(folder):
    """A shell in that folder."""
    with Shell(folder, **VARIABLES) as shell:
        yield shell


@pytest.fixture
def drives(shell):
    """Simulated drives at ./st0 and ./can0 of that folder."""
    shell.run(f"{SERVE} &", [*SERVE.split(), "&"], 0)
