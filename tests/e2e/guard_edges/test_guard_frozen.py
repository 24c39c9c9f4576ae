"""A program that was frozen, and continues after the guard stopped its motors."""

import json
import signal

import pytest

from guarded import PORT, is_told_to_stop, rests, turns, where


@pytest.mark.parametrize(["protocol", "serve"], [("st", "pty"), ("rmd", "unix-listen")])
def test_a_program_that_continues_turns_no_motor_and_gets_an_error(
    bench, start, client, tmp_path, protocol, serve
):
    drives = bench(protocol)
    words = ["-p", PORT[protocol](drives), "--serve", f"{serve}:{tmp_path}/held", "--silence", "500ms", "--json"]
    process = start("guard", protocol, *words)
    port = where(json.loads(process.line(0)))
    program = client(protocol, port, "command")
    turns(drives, protocol)
    program.send_signal(signal.SIGSTOP)
    process.says_halted("motor 1", "the program is silent: ")
    process.says("closed the connection of the silent program")
    rests(drives, protocol)
    program.send_signal(signal.SIGCONT)
    assert program.wait(20) == 1, "it gets an error"
    assert is_told_to_stop(drives, protocol)
    # The next program may turn motors, and the guard reports it.
    client(protocol, port, "command")
    turns(drives, protocol)
    process.says("a program turns motors again")
    # Behind the line of the port. The two outputs are read in threads of their own.
    names = [json.loads(process.line(number))["event"] for number in range(1, 6)]
    assert names == ["came", "stopped", "disconnected", "came", "resumed"], names
