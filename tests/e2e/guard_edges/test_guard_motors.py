"""Which motors a guard stops and how, on either protocol."""

import json
import os

import pytest

from guarded import PORT, rests, turns
from lines import Meddler, RawLine
from program import eventually, plain
from st_wire import ACK, EXECUTE, frame, header


def test_rmd_motors_are_ended_as_told(sim, guard, client):
    for on_loss, mode in (("off", "off"), ("stop", "stopped")):
        drives = sim(st=())
        process = guard("rmd", drives, "--on-loss", on_loss, "--json")
        program = client("rmd", process.port)
        turns(drives, "rmd")
        program.kill()
        eventually(lambda: drives.motor(1)["mode"] == mode, f"the motor is {mode}")
        process.until(lambda: any('"stopped"' in text for text in process.out), "the event")
        event = next(json.loads(text) for text in process.out if '"stopped"' in text)
        assert event["reason"] == "client-gone"
        assert [(motor["motor"], motor["stopped"]) for motor in event["motors"]] == [(1, True)]
        process.interrupt()
        assert process.wait() == 0
        drives.end()


@pytest.mark.parametrize(["on_loss", "code", "mode"], [("stop", "81", "stopped"), ("off", "80", "off")])
def test_an_acknowledge_of_the_programs_own_end_does_not_stand_for_the_guards(
    sim, start, tmp_path, on_loss, code, mode
):
    """The program stops, moves on and dies; replies are late, and the guard's first 0x81 or 0x80 is lost."""
    end = f"t1418{code}".encode()
    drives = sim(st=())
    with Meddler(tmp_path / "bus", drives.can, delay=0.01) as bus:
        serve = f"slcan-pty:{tmp_path}/held"
        words = ["--on-loss", on_loss, "--serve", serve, "--json"]
        process = start("guard", "rmd", "-p", f"slcan:{bus.path}", *words)
        process.line(0)
        with RawLine(tmp_path / "held") as line:
            line.say(b"\rC\rS8\rO\r", b"\r")
            os.write(line.end, end + b"00000000000000\rt1418A2000000A08C0000\r")
            eventually(lambda: bus.passed(b"t1418A2"), "the motor gets a motion command")
            bus.lose(end)
        eventually(lambda: bus.is_lost(end), "the guard's first request is lost")
        process.says(f"motor 1 acknowledged its stop (0x{code})")
        assert drives.motor(1)["mode"] == mode
        assert not any("another node" in text for text in process.err), process.err


def test_what_other_nodes_command_is_reported(sim, start, client, run, tmp_path):
    drives = sim(st=(), rmd=("tcp",))
    port = f"slcan:tcp:{drives.can_address}"
    process = start("guard", "rmd", "-p", port, "--serve", f"slcan-pty:{tmp_path}/held", "--json")
    process.line(0)
    program = client("rmd", f"{tmp_path}/held", "poll")
    other = ("rmd", "-p", port, "--timeout", "500ms", "--id", 3)
    run(*other, "status").ended(0)
    assert not any("another node" in text for text in process.err), process.err
    run(*other, "speed", 100).ended(0)
    process.says("motor 3 is commanded by another node of the bus (0xa2)")
    program.kill()
    process.says("motor 1 acknowledged its stop")
    assert drives.motor(3)["mode"] == "speed", "it is another's"


@pytest.mark.parametrize("protocol", PORT)
def test_a_guard_proves_that_it_stops_a_motor(bench, run, protocol):
    drives = bench(protocol)
    speed = {"st": 1200, "rmd": 300}[protocol]
    words = ["guard", protocol, "-p", PORT[protocol](drives), "--prove", "--spin", speed]
    shown = run(*words, within=60).ended(0)
    assert "acknowledged its stop after" in shown.out and "seen at rest after" in shown.out
    assert "SIGKILL" in shown.err
    proof = run(*words, "--json", within=60).ended(0).json
    assert proof["ok"] and proof["motor"] == 1
    values = plain(proof)
    assert values["speed"] >= 0.8 * speed
    assert 0 < values["stopped_after"] < values["still_after"]
    rests(drives, protocol)


def test_what_cannot_be_guarded_is_told(run):
    for words, says in [
        (["-p", "socketcan:can0"], "guard rmd"),
        (["rmd", "-p", "/dev/ttyACM0"], "use slcan:"),
        (["rmd", "-p", "sim:"], "end with it"),
    ]:
        assert says in run("guard", *words).ended(2).err


def test_the_pfc_that_a_program_enabled_is_disabled(sim, guard):
    drives = sim(rmd=())
    process = guard("st", drives)
    line = os.open(process.port, os.O_RDWR | os.O_NOCTTY)
    os.write(line, frame(header(EXECUTE, 1), [0x0A]))
    assert os.read(line, 16)[0] == ACK
    os.close(line)
    process.says("the PFC acknowledged its stop (PFC_DISABLE)")
