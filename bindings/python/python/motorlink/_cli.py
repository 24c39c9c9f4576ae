"""The command ``motorlink``: the same code as the program of that name."""

import sys

from motorlink import _core


def main() -> int:
    """Does what the command line says; gives the exit code."""
    return _core.cli(["motorlink", *sys.argv[1:]])
