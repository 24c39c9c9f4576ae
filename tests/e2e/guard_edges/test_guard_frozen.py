"""A program that was frozen, and continues after the guard stopped its motors."""

import json
import signal

import pytest

from guarded import PORT, PTY, is_told_to_stop, rests, turns, where


@pytest.mark.parametrize("serve", ["pty", "unix-listen", "tcp-listen"])
@pytest.mark.parametrize("protocol", PORT)
def test_a_program_that_continues_turns_no_motor_and_gets_an_error(
    bench, start, client, tmp_path, protocol, serve
):
    drives = bench(protocol)
    name = {
        "pty": f"{PTY[protocol]}:{tmp_path}/held",
        "unix-listen": f"unix-listen:{tmp_path}/held.sock",
        "tcp-listen": "tcp-listen:127.0.0.1:0",
    }[serve]
    words = ["-p", PORT[protocol](drives), "--serve", name, "--silence", "500ms", "--json"]
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
