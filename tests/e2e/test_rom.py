"""`motorlink sim --rom`: ROM contents are kept after the process has ended for any reason.

What is refused in its folder is tested in crates/testbench/src/rom/tests.rs.
"""

import random
import shutil
import threading

import pytest
import serial

READ_GAINS, WRITE_GAINS_TO_ROM, READ_ENCODER, WRITE_OFFSET, ZERO_TO_ROM = 0x30, 0x32, 0x90, 0x91, 0x19


class Slcan:
    """RMD motor 1 on an slcan adapter, byte by byte."""

    def __init__(self, path):
        # A write to ROM waits for the disk.
        self.port = serial.Serial(path, timeout=60)
        self.port.write(b"C\rS8\rO\r")
        for _ in range(3):
            assert self.port.read(1) in (b"\r", b"\x07")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.port.close()

    def ask(self, *data):
        """Sends a request; gives the reply's bytes, or None if there is none."""
        request = bytes(data).ljust(8, b"\0")
        self.port.write(b"t1418" + request.hex().encode() + b"\r")
        while line := self.port.read_until(b"\r"):
            if line.startswith(b"t1418") and line.endswith(b"\r"):
                return bytes.fromhex(line[5:21].decode())
        return None


def gains(number):
    """Six gains that tell a number apart from all others below 2**24."""
    low, middle, high = number.to_bytes(3, "little")
    return low, middle, high, low ^ 0xFF, middle ^ 0xFF, high ^ 0xFF


def number_of(reply):
    low, middle, high = reply[2:5]
    assert tuple(reply[2:8]) == gains(low | middle << 8 | high << 16), f"torn: {reply.hex(' ')}"
    return low | middle << 8 | high << 16


def test_gains_and_zero_outlive_the_process(sim, tmp_path):
    drives = sim("--rom", tmp_path / "rom", st=())
    with Slcan(drives.can) as motor:
        motor.ask(WRITE_GAINS_TO_ROM, 0, *gains(77))
        assert motor.ask(0x31, 0, *gains(78))[0] == 0x31, "in RAM only"
        motor.ask(WRITE_OFFSET, 0, 0, 0, 0, 0, 0x34, 0x12)
    drives.kill()
    drives = sim("--rom", tmp_path / "rom", st=())
    with Slcan(drives.can) as motor:
        assert number_of(motor.ask(READ_GAINS)) == 77
        assert motor.ask(READ_ENCODER)[6:8] == b"\x34\x12"
        raw = motor.ask(READ_ENCODER)[4:6]
        assert motor.ask(ZERO_TO_ROM)[6:8] == raw
    drives.kill()
    with Slcan(sim("--rom", tmp_path / "rom", st=()).can) as motor:
        assert motor.ask(READ_ENCODER)[6:8] == raw
        assert number_of(motor.ask(READ_GAINS)) == 77


def test_killed_at_any_moment_it_keeps_what_it_acknowledged(sim, tmp_path):
    """After each kill the ROM has the value that was acknowledged last, or the one in flight."""
    chance = random.Random(1)
    possible, sent = None, 0
    for _ in range(20):
        drives = sim("--rom", tmp_path / "rom", st=())
        with Slcan(drives.can) as motor:
            if possible:
                kept = number_of(motor.ask(READ_GAINS))
                assert kept in possible
                possible = {kept}
            else:
                motor.ask(WRITE_GAINS_TO_ROM, 0, *gains(0))
                possible = {0}
            # Into the stream of writes, at a random moment of it.
            killer = threading.Timer(chance.uniform(0, 0.005), drives.process.kill)
            begin = sent + chance.randrange(1, 6)
            try:
                while True:
                    sent += 1
                    if sent == begin:
                        killer.start()
                    possible.add(sent)
                    if motor.ask(WRITE_GAINS_TO_ROM, 0, *gains(sent)) is None:
                        break
                    possible = {sent}
            except (OSError, serial.SerialException):
                pass
            killer.join()
            drives.wait()


def test_a_damaged_rom_and_a_foreign_file_are_told_and_left_alone(run, tmp_path):
    rom, precious = tmp_path / "rom", tmp_path / "precious"
    rom.mkdir()
    precious.write_text("precious")
    file = rom / "bus1-motor1.rom"
    for make in (lambda: file.write_bytes(b"\xff" * 100), lambda: file.symlink_to(precious)):
        make()
        done = run("sim", "--rom", rom, "--rmd", f"slcan-pty:{tmp_path}/x", "--stdin").ended(2)
        assert str(file) in done.err and "it was not changed" in done.err and "move it away" in done.err
        assert file.read_bytes() in (b"\xff" * 100, b"precious")
        file.unlink()


def test_a_folder_of_rom_is_one_simulators(sim, run, tmp_path):
    sim("--rom", tmp_path / "rom")
    done = run("sim", "--rom", tmp_path / "rom", "--stdin").ended(2)
    assert "another simulator uses the ROM" in done.err


def test_what_cannot_be_kept_is_not_acknowledged(sim, tmp_path):
    drives = sim("--rom", tmp_path / "rom", st=())
    with Slcan(drives.can) as motor:
        shutil.rmtree(tmp_path / "rom")
        with pytest.raises((OSError, serial.SerialException, AssertionError)):
            assert motor.ask(WRITE_GAINS_TO_ROM, 0, *gains(5)) is not None
    assert drives.wait() == 3
    assert any("cannot keep ROM" in text for text in drives.err), drives.err
