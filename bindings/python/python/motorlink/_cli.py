"""The command ``motorlink``: the same code as the program of that name."""

import signal
import sys

from motorlink import _core


def main() -> int:
    """Does what the command line says; gives the exit code."""
    # Python's own would raise KeyboardInterrupt once more when the command has ended in order.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.cli(["motorlink", *sys.argv[1:]])
