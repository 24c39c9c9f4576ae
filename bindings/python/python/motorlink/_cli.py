"""The command ``motorlink``: the same code as the program of that name."""

import signal
import sys

from motorlink import _core


def main() -> int:
    """Executes the command line. Returns the exit code."""
    # Python's handler would raise KeyboardInterrupt again after the command has ended.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    program = [sys.executable, "-m", "motorlink"]
    return _core.cli(program, ["motorlink", *sys.argv[1:]])
