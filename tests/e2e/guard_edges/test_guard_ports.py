"""What programs and servers leave of a port: bytes under way, modes of a pty, links."""

import os
import termios
import time
from pathlib import Path

import pytest

from program import Sim


@pytest.mark.parametrize(["protocol", "serve"], [("st", "pty"), ("rmd", "unix-listen"), ("st", "tcp-listen")])
def test_what_a_dead_program_left_does_not_delay_the_stop(slow, guard, client, tmp_path, protocol, serve):
    line = slow(protocol)
    at = "127.0.0.1:0" if serve == "tcp-listen" else f"{tmp_path}/held"
    process = guard(protocol, line, serve=f"{serve}:{at}")
    program = client(protocol, process.port, "flood")
    line.flooded()
    program.kill()
    began = time.monotonic()
    line.stopped()
    passed = line.bytes_since(began)
    # The buffers of sockets and ptys hold much more. A machine under load needs a part of it to react.
    assert passed < 2 * line.BYTES_PER_SECOND, f"{passed} bytes went before the stop"
    process.says("were not passed on")


def test_what_a_program_left_of_a_pty_does_not_harm_the_next(bench, guard, run):
    drives = bench("st")
    process = guard("st", drives)
    line = os.open(process.port, os.O_RDWR | os.O_NOCTTY)
    modes = termios.tcgetattr(line)
    modes[3] |= termios.ECHO | termios.ICANON
    termios.tcsetattr(line, termios.TCSANOW, modes)
    termios.tcflow(line, termios.TCOOFF)
    os.close(line)
    process.says("closed the port")
    run("st", "-p", process.port, "get", "SPEED_KP").ended(0)


def test_a_link_whose_pty_is_anothers_by_now_is_an_error(sim, run, tmp_path):
    drives = sim(rmd=())
    link = Path(drives.st)
    number = os.path.basename(os.path.realpath(link))
    drives.kill()
    others = []
    try:
        while not os.path.exists(f"/dev/pts/{number}"):
            others.append(os.openpty())
        message = run("st", "-p", link, "start").ended(3)
        assert "stale" in message.err and "another program" in message.err
        # So it is through a link to the link.
        (tmp_path / "alias").symlink_to(link)
        assert "stale" in run("st", "-p", tmp_path / "alias", "info").ended(3).err
        for master, _ in others:
            os.set_blocking(master, False)
            with pytest.raises(BlockingIOError):
                os.read(master, 16)
    finally:
        for pair in others:
            for end in pair:
                os.close(end)
    # The next server has the place again.
    drives = sim(rmd=())
    run("st", "-p", drives.st, "info").ended(0)


def test_a_link_does_not_lead_to_the_drive_of_another_server(sim, motorlink, run, tmp_path):
    first = sim(rmd=())
    number = os.path.basename(os.path.realpath(first.st))
    first.kill()
    second = None
    for attempt in range(50):
        second = Sim([motorlink, "sim", "--st", f"pty:{tmp_path}/other{attempt}"], 1)
        if os.path.basename(os.path.realpath(second.st)) == number:
            break
        second.end()
    else:
        pytest.fail("no pty got the number again")
    try:
        assert "stale" in run("st", "-p", first.st, "start").ended(3).err
        run("st", "-p", second.st, "info").ended(0)
        assert second.motor(1)["status"] == "IDLE"
    finally:
        second.end()


def test_a_link_of_the_users_own_is_never_deleted(run, tmp_path):
    link, target = tmp_path / "drive", "/dev/ttyUSB99"
    link.symlink_to(target)
    for words in (["sim", "--stdin", "--st", f"pty:{link}"], ["sim", "--stdin", "--st", f"unix-listen:{link}"]):
        assert "remove it or choose another path" in run(*words).ended(3).err
        assert os.readlink(link) == target
