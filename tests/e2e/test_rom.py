"""`motorlink sim --rom`: ROM contents are kept after the process has ended for any reason."""

import os
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
    for _ in range(60):
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


def test_a_damaged_rom_is_told_and_left_alone(sim, run, tmp_path):
    drives = sim("--rom", tmp_path / "rom", st=())
    with Slcan(drives.can) as motor:
        motor.ask(WRITE_GAINS_TO_ROM, 0, *gains(5))
    drives.end()
    (file,) = (tmp_path / "rom").glob("*.rom")
    for damaged in (file.read_bytes()[:20], b"", b"\xff" * 100, b"precious\n"):
        file.write_bytes(damaged)
        done = run("sim", "--rom", tmp_path / "rom", "--rmd", f"slcan-pty:{tmp_path}/x", "--stdin")
        assert str(file) in done.ended(2).err and "move it away" in done.err
        assert file.read_bytes() == damaged


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


@pytest.mark.parametrize("name", ["bus1-motor1.rom", "bus1-motor1.new", "lock"])
@pytest.mark.parametrize("kind", ["link", "dangling", "fifo", "folder", "device"])
def test_nothing_but_its_own_files_is_touched(run, tmp_path, name, kind):
    """Refused at once, with the name; what a link leads to stays as it is."""
    rom, precious = tmp_path / "rom", tmp_path / "precious"
    rom.mkdir()
    precious.write_text("precious")
    place = rom / name
    made = {
        "link": lambda: place.symlink_to(precious),
        "dangling": lambda: place.symlink_to(tmp_path / "nothing"),
        "fifo": lambda: os.mkfifo(place),
        "folder": place.mkdir,
        "device": lambda: place.symlink_to("/dev/zero"),
    }
    made[kind]()
    done = run("sim", "--rom", rom, "--rmd", f"slcan-pty:{tmp_path}/can", "--stdin").ended(2)
    assert str(place) in done.err and "not changed" in done.err, done.err
    assert precious.read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["precious", "rom"]
    assert os.path.lexists(place)


def test_a_folder_behind_a_link_is_refused(run, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "rom").symlink_to(tmp_path / "elsewhere")
    done = run("sim", "--rom", tmp_path / "rom", "--stdin").ended(2)
    assert "symbolic link" in done.err
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_lock_file_of_another_program_is_left_alone(run, tmp_path):
    (tmp_path / "lock").write_text("pid 4711")
    done = run("sim", "--rom", tmp_path, "--stdin").ended(2)
    assert str(tmp_path / "lock") in done.err
    assert (tmp_path / "lock").read_text() == "pid 4711"
