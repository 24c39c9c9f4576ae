"""Every line that `--json` prints follows docs/json.schema.json, on stdout and on stderr."""

import json
import re
import subprocess
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from peers import device, slcan_adapter
from program import environment, eventually
from recordings import short
from sharing import Client

DOCS = Path(__file__).parents[2] / "docs"
SCHEMA = json.loads((DOCS / "json.schema.json").read_text())
VALIDATOR = Draft202012Validator(SCHEMA)

#: What reads or acts on a drive, as a person gives it.
ST = [
    *("info", "status", "registers", "get SPEED_MEAS FLAGS STATUS DAC_OUT1 0x3F", "segment SPEED_MEAS I_A"),
    *("set SPEED_KP 3 --verify", "start --ramp 900 100 --speed-limit 1000", "stop", "start-stop", "stop-ramp", "ramp 100 100"),
    *("revup-data", "revup-data 1 500 200 250", "current-reference 100 -5", "fault-ack", "encoder-align", "iqdref-clear"),
    *("pfc enable", "raw 02 40", "get SPEED_MEAS --every 5ms --count 2", "--raw get SPEED_MEAS FLAGS"),
    *("set TORQUE_REF 0.1 --full-scale 16.5", "revup-data --full-scale 16.5"),
]
#: What the other profile has.
MCSDK = ["torque-ramp 100 50", "position 1.5rad 0.5s", "get SPEED_MEAS SC_RS"]
RMD = [
    *("scan 1 2", "status", "angle", "angle --every 5ms --count 2", "--raw status", "pid speed_kp=5"),
    *("acceleration", "encoder", "encoder-offset 5 --write-rom", "zero --write-rom"),
    *("off --id 1", "stop --id 1", "run"),
    *("torque 0.1", "speed 20", "position 10", "single-turn-position 45.5 cw --full-turn", "clear-errors"),
    *("torque4 0 0 0 0", "raw 9a"),
    *("status --gear-ratio 6 --encoder-bits 14", "encoder --encoder-bits 14", "acceleration 9 --gear-ratio 6"),
]
#: What a running share is asked for.
SHARE = ["stop", "latch", "release"]
#: test_node.py, test_fleet.py and test_site.py check their lines.
FLEET = ["list", "watch", "record", "command", "settings", "stop-all", "latch", "release", "init", "router"]
#: Captures, in hexadecimal.
DECODE = {
    "st": ["22 01 1e 41 f0 04 ce 07 00 00 ca", "ff 01 0b 0c", "27 06 e8 03 00 00 f4 01 0f", "29 01 02 2c"],
    "rmd": ["141#9A1900F000000009", "141#9A00000000000000", "280#640000009CFFD007", "7FF#00", "00000141#R"],
}
#: test_settings_files.py checks their lines.
FILES = ["dump", "diff", "restore"]
#: What reads a recording.
RECORDINGS = [
    *("info FILE", "info FILE --events", "info FILE --settings st0/motor1", "recover FILE"),
    *("convert FILE OUT.csv", "plot FILE -o OUT.svg"),
]
SCAN = "`motorlink rmd -p sim: scan` lists the motors that answer"


def check(text):
    """Lines that follow the schema."""
    lines = [json.loads(line) for line in text.splitlines()]
    for line in lines:
        VALIDATOR.validate(line)
    return lines


@pytest.fixture
def checked(run):
    """Runs the program with --json; gives stdout and stderr as objects."""

    def checked(*words, code=0, **options):
        done = run(*words, "--json", **options).ended(code)
        return check(done.out), check(done.err)

    return checked


def subcommands(run, *words):
    """The commands that the help of a command lists."""
    commands = run(*words, "--help").ended(0).out.split("Commands:\n")[1].split("\n\n")[0]
    return set(re.findall(r"^  ([a-z0-9-]+)", commands, re.M)) - {"help"}


def word(command):
    """The subcommand of a command with options before it."""
    return next(word for word in command.split() if not word.startswith("-"))


def test_the_schema_is_one():
    Draft202012Validator.check_schema(SCHEMA)


def test_every_subcommand_is_tested_here(run):
    assert subcommands(run, "st") == {word(command) for command in [*ST, *MCSDK, *FILES]} | {"scan"}
    assert subcommands(run, "rmd") == {word(command) for command in [*RMD, *FILES]}
    others = {"demo", "watch", "spec", "completions", "man", *(word(command) for command in RECORDINGS)}
    assert subcommands(run, "share") == set(SHARE)
    assert subcommands(run, "fleet") == set(FLEET)
    assert subcommands(run) == {"st", "rmd", "ports", "sim", "guard", "share", "node", "fleet", "monitor", "record", "replay", "conformance", "decode"} | others


@pytest.mark.parametrize("protocol", DECODE)
def test_decode_tells_what_was_captured(checked, run, protocol):
    assert subcommands(run, "decode") == set(DECODE)
    for words in DECODE[protocol]:
        out, err = checked("decode", protocol, *words.split())
        assert out and not err
    out, err = checked("decode", protocol, stdin="(1.0) can0 20000004#00\n(1.0) can0 142##100\nhello\n", code=1)
    assert len(out) == 3 and "damage" in out[2]
    assert "frame" in err[0]["note"] and err[1]["error"]["kind"] == "damaged"


@pytest.mark.parametrize("command", ST)
def test_st_tells_what_was_done_or_read(checked, command):
    out, err = checked("st", "-p", "sim:", *command.split())
    assert out and not err
    if command not in ("info", "registers"):
        assert all((line["motor"], line["port"]) == (1, "sim:") for line in out)


@pytest.mark.parametrize("command", MCSDK)
def test_st_tells_what_the_other_profile_has(checked, tmp_path, command):
    config = tmp_path / "servo.toml"
    config.write_text('profile = "mcsdk-5.4"\n[[st.motor]]\npreset = "servo"\n')
    port = ("-p", f"sim:{config}", "--profile", "mcsdk-5.4")
    out, err = checked("st", *port, *command.split(), code=1 if "SC_RS" in command else 0)
    assert out and bool(err) == ("SC_RS" in command)


@pytest.mark.parametrize("command", RMD)
def test_rmd_tells_what_was_done_or_read(checked, command):
    out, err = checked("rmd", "-p", "sim:", "--timeout", "500ms", *command.split())
    assert out and not err
    assert all(line["motor"] in range(1, 5) and line["port"] == "sim:" for line in out)


@pytest.mark.parametrize(
    "words, code, error",
    [
        ("st -p sim: set STATUS 1", 1, {"kind": "refused", "motor": 1, "name": "SET_READ_ONLY", "code": 2}),
        ("st -p sim: -m 5 status", 1, {"kind": "refused", "motor": 5, "name": "BAD_MOTOR_SELECTED"}),
        ("st -p sim: get SPEED_MES", 2, {"kind": "usage", "port": "sim:"}),
        ("st info", 2, {"kind": "usage"}),
        ("st -p sim: fly", 2, {"kind": "usage"}),
        ("st -p /dev/nothing-there info", 3, {"kind": "link", "port": "serial:/dev/nothing-there"}),
        ("rmd -p sim: zero", 2, {"kind": "usage", "try": "add --write-rom to allow it"}),
        ("rmd -p sim: -i 9 status", 3, {"kind": "silent", "motor": 9, "try": SCAN}),
        ("rmd -p sim: scan 9", 3, {"kind": "link"}),
        ("guard st -p sim:", 2, {"kind": "usage"}),
        ("monitor --share unix:./nowhere --listen 127.0.0.1:0", 3, {"kind": "link"}),
        ("sim run /nothing-there.toml", 2, {"kind": "usage"}),
    ],
)
def test_a_failure_is_an_object_on_stderr(checked, words, code, error):
    out, err = checked(*words.split(), code=code)
    assert not out
    (line,) = err
    assert (line["ok"], line["exit"]) == (False, code)
    assert line["error"].items() >= error.items()


def test_a_refused_register_has_an_error_beside_the_values_of_the_others(checked):
    out, err = checked("st", "-p", "sim:", "get", "SPEED_MEAS", "I_A", "IQ_SPEEDMODE", "STATUS", code=1)
    assert list(out[0]["values"]) == ["SPEED_MEAS", "STATUS"]
    assert list(out[0]["errors"]) == ["I_A", "IQ_SPEEDMODE"]
    assert out[0]["errors"]["I_A"]["try"] == "use `st segment I_A`"
    assert err[0]["error"] == out[0]["errors"]["I_A"]


def test_revup_data_has_digits(checked):
    phases, _ = checked("st", "-p", "sim:", "--raw", "revup-data")
    assert len(phases) == 5
    for phase in phases:
        assert list(phase["values"]) == ["speed", "torque", "duration"]
        assert all(list(value) == ["digits"] for value in phase["values"].values())


def test_a_silent_drive_is_told(checked, tmp_path):
    with device(tmp_path / "silent") as port:
        for command in ("info", "raw 02 40"):
            out, err = checked("st", "-p", port, "--timeout", "50ms", *command.split(), code=3)
            assert not out and err[0]["error"]["kind"] == "link"
            assert err[0]["error"]["port"] == f"serial:{port}"
        out, _ = checked("st", "-p", port, "--timeout", "50ms", "scan", 115200, code=3)
        assert [line["finding"] for line in out] == ["silence"]


@pytest.mark.parametrize(
    "deliver, command",
    [(lambda frame: [frame], "status"), (lambda frame: [frame[:-1] + "1"], "acceleration 9")],
)
def test_an_adapter_that_echoes_and_a_damaged_reply_are_no_silence(checked, tmp_path, deliver, command):
    with device(tmp_path / "can", slcan_adapter(deliver)) as link:
        _, err = checked("rmd", "-p", f"slcan:{link}", *command.split(), code=3)
    error = err[0]["error"]
    assert (error["kind"], error["motor"], error["port"]) == ("link", 1, f"slcan:{link}")


def test_a_full_disk_is_not_the_ports_failure(motorlink):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [motorlink, "st", "-p", "sim:", "info", "--json"],
            **{"stdout": full, "stderr": subprocess.PIPE, "text": True, "env": environment()},
        )
    (line,) = check(done.stderr)
    assert done.returncode == line["exit"] == 3
    assert line["error"]["kind"] == "output" and "port" not in line["error"]


def test_a_scan_for_rates_tells_what_it_found(checked, drives):
    out, _ = checked("st", "-p", drives.port("pty"), "scan", 115200)
    assert out[0]["finding"] == "drive"


def test_a_motor_that_is_silent_among_others_has_a_line(checked, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\n")
    out, err = checked("rmd", "-p", f"sim:{config}", "torque4", 0, 0, 0, 0, code=3)
    assert [(line["motor"], line["ok"]) for line in out] == [(1, True), (2, False), (3, False), (4, False)]
    assert all(line["error"]["kind"] == "silent" for line in out[1:])
    assert err[0]["error"]["motor"] == 2


def test_an_error_that_stays_has_its_values(checked, tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text("[[rmd.motor]]\nid = 1\nplant.supply.voltage = 5.0\n")
    out, err = checked("rmd", "-p", f"sim:{config}", "clear-errors", code=1)
    assert out[0]["ok"] is False and out[0]["values"]["errors"]["names"] == ["LOW_VOLTAGE"]
    assert err[0]["error"] == out[0]["error"]


def test_an_outage_of_a_watch_is_in_its_stream_and_so_is_its_end(sim, start):
    drives = sim(rmd=())
    watch = start("st", "-p", drives.st, "--timeout", "500ms", "--json", "segment", "SPEED_MEAS", "--every", "100ms")
    watch.more_lines(2)
    drives.kill()
    watch.until(lambda: any('"outage"' in line for line in watch.out), "the outage")
    sim(rmd=())
    watch.until(lambda: any('"back"' in line for line in watch.out), "its end")
    watch.more_lines(2)
    watch.interrupt()
    assert watch.wait() == 0
    lines = check("\n".join(watch.out))
    # A machine that stood still makes the line slower.
    assert all(line.startswith('{"note":') for line in watch.err), watch.err
    assert [line["event"] for line in lines if "event" in line] == ["outage", "back"]
    assert [line["t"] for line in lines] == sorted(line["t"] for line in lines)
    assert all((line["motor"], line["port"]) == (1, f"serial:{drives.st}") for line in lines)


def test_a_guard_tells_what_happens(sim, start, run, tmp_path):
    drives = sim(rmd=())
    guard = start("guard", "st", "-p", drives.st, "--serve", f"pty:{tmp_path}/held", "--json")
    guard.line(0)
    run("st", "-p", tmp_path / "held", "start").ended(0)
    guard.until(lambda: any('"stopped"' in line for line in guard.out), "the motor is stopped")
    drives.kill()
    guard.until(lambda: any('"port-lost"' in line for line in guard.out), "the port is lost")
    guard.interrupt()
    guard.wait()
    assert check("\n".join(guard.out)) and check("\n".join(guard.err))


def test_a_share_tells_what_happens(sim, start, checked, tmp_path):
    drives, path = sim(), tmp_path / "share"
    share = start("share", "-p", drives.st, "--at", f"unix:{path}", "--json")
    share.line(0)
    client = Client(path, "tuner")
    client.command("st0", 1, 3, 1)
    share.until(lambda: any('"commanded"' in line for line in share.out), "a command")
    client.socket.close()
    share.until(lambda: any('"stopped"' in line for line in share.out), "the motor is stopped")
    for request, event in zip(SHARE, ("stopped", "latched", "released")):
        (told,), _ = checked("share", request, "--at", f"unix:{path}")
        assert told["event"] == event, told
    share.interrupt()
    share.wait()
    assert len(check("\n".join(share.out))) > 4


def test_a_monitor_tells_where_browsers_connect(start, checked, tmp_path):
    path = tmp_path / "share"
    monitor = start("monitor", "--listen", "127.0.0.1:0", "--at", f"unix:{path}", "--json")
    (ready,) = check(monitor.line(0))
    assert ready["simulated"] and ready["url"] != ready["viewer_url"]
    shown = start("monitor", "--listen", "127.0.0.1:0", "--share", f"unix:{path}", "--json")
    (other,) = check(shown.line(0))
    assert (other["lines"], other["simulated"]) == (ready["lines"], False)
    checked("monitor", "--listen", ready["url"].split("/")[2], code=3)
    for process in (shown, monitor):
        process.interrupt()
        assert process.wait() == 0
        check("\n".join(process.out))


@pytest.mark.parametrize("command", RECORDINGS)
def test_a_recording_is_told_about(checked, tmp_path, command):
    path = tmp_path / "run.mcap"
    short(path)
    words = command.replace("FILE", str(path)).replace("OUT", str(tmp_path / "out")).split()
    out, err = checked(*words)
    assert out and not err
    path.write_bytes(path.read_bytes()[:5000])
    out, err = checked(*words, *(("--force",) if "OUT" in command else ()), code=4 if "recover" in words else 0)
    assert out and bool(err) == (words[0] != "info" or "--events" in words)


def test_a_recording_tells_how_far_it_is(checked, tmp_path):
    words = ("-o", tmp_path / "run.mcap", "--duration", "2500ms", "--timeout", "1s")
    out, err = checked("record", "-p", "sim:", *words)
    assert [line["event"] for line in out] == ["recording", "progress", "progress", "recorded"] and not err
    assert out[0]["lines"][0] == {"label": "st", "port": "sim:", "motors": [1, 2]}
    assert [line["label"] for line in out[0]["lines"]] == ["st", "rmd"]
    assert out[-1]["lost"] == 0 and out[-1]["values"] > 0
    _, (failed,) = checked("record", "-p", "sim:", *words, code=2)
    assert failed["error"]["kind"] == "usage"


def test_a_guard_tells_what_it_proved(sim, checked):
    out, _ = checked("guard", "st", "-p", sim(rmd=()).st, "--prove", "--spin", 1200, within=60)
    assert out[0]["ok"] and out[0]["values"]["speed"]["unit"] == "rpm"


def test_simulated_drives_answer(sim):
    drives = sim("--json")
    drives.command("supply", motor=99, volts=3)
    drives.do("fault", port=drives.ports[0]["port"], motor=1, fault="BREAK_IN", hold=True)
    eventually(lambda: drives.motor(1, drives.ports[0]["port"])["faults"]["present"], "the fault")
    drives.say("garbage")
    drives.do("state")
    assert len(check("\n".join(drives.out))) >= 7


def test_scenarios_presets_and_ports_are_told(checked):
    for words in (("sim", "presets"), ("ports",)):
        checked(*words)
    shipped = DOCS.parent / "scenarios/position-moves.toml"
    out, err = checked("sim", "run", shipped, within=120)
    assert out[0]["ok"] and out[0]["duration"]["unit"] == "s"
    assert "faster than real time" in err[0]["note"]


@pytest.mark.parametrize("words", ["st -p sim: --only ST-4.5-01", "rmd -p sim: --only RMD-33"])
def test_the_conformance_kit_reports(checked, words):
    out, _ = checked("conformance", *words.split(), within=120)
    assert out[0]["cases"]
