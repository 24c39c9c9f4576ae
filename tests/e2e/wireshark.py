"""tshark with the dissector that `motorlink spec wireshark` writes, and the frames of the example."""

import json
import os
import random
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest
from pcapng import RTAC_SERIAL, SOCKETCAN, Capture

PROFILES = ("spec", "mcsdk-5.4")
ALL_RMD, ALL_ST = ["motorlink.rmd.claim:all"], ["motorlink.st.claim:all"]
USER0_IS_ST = 'uat:user_dlts:"User 0 (DLT=147)","motorlink.st","0","","0",""'
GET_SPEED = bytes.fromhex("02011e21")
SPEED_1500 = bytes.fromhex("f004dc050000d6")
NACK = bytes.fromhex("ff010a0b")


@pytest.fixture(scope="session")
def dissector(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("wireshark") / "motorlink.lua"
    done = run("spec", "wireshark", "-o", path)
    assert done.code == 0, done.err
    return path


@pytest.fixture(scope="session")
def tshark(dissector, tmp_path_factory):
    """Runs tshark on a capture. No run may report an error of Lua."""
    home = tmp_path_factory.mktemp("home")

    def tshark(capture, *arguments, preferences=()):
        path = capture.write(home / f"{random.getrandbits(64):x}.pcapng")
        command = ["tshark", "-n", "-r", path, "-X", f"lua_script:{dissector}", *arguments]
        for preference in preferences:
            command += ["-o", preference]
        own = {"HOME": str(home), "XDG_CONFIG_HOME": str(home), "XDG_DATA_HOME": str(home)}
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, env={**os.environ, **own})
        assert done.returncode == 0 and "lua" not in done.stderr.lower(), done.stderr
        assert "Lua Error" not in done.stdout and "_ws.lua.error" not in done.stdout
        path.unlink()
        return done.stdout

    return tshark


@pytest.fixture(scope="session")
def packets(tshark):
    """The fields of each packet, by name: `{name: [value, ..]}`."""

    def packets(capture, *arguments, preferences=()):
        out = tshark(capture, "-T", "json", *arguments, preferences=preferences)
        found = json.loads(out, object_pairs_hook=lambda pairs: pairs)
        assert len(found) == capture.count
        return [flat(dict(dict(packet)["_source"])["layers"]) for packet in found]

    return packets


def flat(pairs, fields=None):
    fields = defaultdict(list) if fields is None else fields
    for name, value in pairs:
        if isinstance(value, list):
            flat(value, fields)
        elif name.startswith(("motorlink.", "can.")):
            fields[name].append(value)
    return fields


@pytest.fixture(scope="session")
def sets(motorlink):
    """The frames of the example, by set."""
    frames = Path(motorlink).parent / "examples/wireshark_frames"
    if not frames.exists():
        pytest.fail(f"{frames} is not built: `cargo build -p motorlink-spec --example wireshark_frames`")
    done = subprocess.run([frames], capture_output=True, text=True, check=True, timeout=60)
    sets = defaultdict(list)
    for line in done.stdout.splitlines():
        frame = json.loads(line)
        frame["data"] = bytes.fromhex(frame["data"])
        sets[frame["set"]].append(frame)
    return sets


def some(frames, share):
    """A share of the requests by a fixed seed, each with its reply."""
    chance, is_taken, taken = random.Random(1), False, []
    for frame in frames:
        is_taken = is_taken if frame["answers"] else chance.random() < share
        taken += [frame] * is_taken
    return taken


def on_can(frames, told=True):
    capture = Capture(SOCKETCAN)
    for frame in frames:
        capture.can(frame["id"], frame["data"], frame["sent"] if told else None)
    return capture


def on_line(frames):
    capture = Capture(RTAC_SERIAL)
    for frame in frames:
        # So late that no reply to an earlier request comes any more.
        capture.serial(frame["data"], frame["sent"], after_ms=1001 if frame["sent"] else 1)
    return capture
