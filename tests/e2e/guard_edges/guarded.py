"""What the guard is called with, and what its motors do, for each protocol."""

import signal

from program import eventually
from st_wire import EXECUTE, frame, header

#: What ends a guard in order, and what suspends a program that does not handle it.
ENDING = [
    *[signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT],
    *[signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM, signal.SIGVTALRM, signal.SIGPROF],
    *[signal.SIGPWR, signal.SIGRTMIN, signal.SIGRTMAX],
]
SUSPENDING = [signal.SIGTSTP, signal.SIGTTOU, signal.SIGTTIN]

# What the guard is called with, and what the drive's own port is, for each protocol.
PORT = {"st": lambda drives: drives.st, "rmd": lambda drives: f"slcan:{drives.can}"}
PTY = {"st": "pty", "rmd": "slcan-pty"}
START = {"st": frame(header(EXECUTE, 1), [1]), "rmd": b"O\rt1418A2000000A08C0000\r"}


def is_turning(drives, protocol):
    motor = drives.motor(1)
    return motor["mode"] not in ("off", "stopped") if protocol == "rmd" else motor["status"] == "RUN"


def turns(drives, protocol):
    eventually(lambda: is_turning(drives, protocol), "the motor turns")


def is_told_to_stop(drives, protocol):
    """An ST motor passes other states before it is IDLE again."""
    motor = drives.motor(1)
    if protocol == "rmd":
        return motor["mode"] in ("off", "stopped")
    return motor["status"] in ("ANY_STOP", "STOP", "STOP_IDLE", "WAIT_STOP_MOTOR", "IDLE")


def rests(drives, protocol):
    def is_at_rest():
        motor = drives.motor(1)
        return motor["mode"] in ("off", "stopped") if protocol == "rmd" else motor["status"] == "IDLE"

    eventually(is_at_rest, "the motor rests", within=20)


def where(announced):
    """What turning.py takes for an announced port."""
    kind, _, path = announced["port"].partition(":")
    return {"tcp-listen": path, "unix-listen": f"unix:{path}"}.get(kind, path)
