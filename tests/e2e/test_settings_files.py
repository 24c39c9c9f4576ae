"""Settings as text: `dump`, `diff` and `restore` of both protocols, and what is left of a restore that fails.

What a file may have, and what a restore writes, is tested in crates/motorlink/tests/settings.
"""

import re
import threading
import time
from contextlib import ExitStack

import pytest

from peers import device
from st_wire import SET_REG, Line, header
from test_json import check
from test_settings import drive, value

#: Each protocol with two settings, an RMD motor's with a motor that answers a busy machine.
PROTOCOLS = {
    "st": (("SPEED_KP", 950), ("REVUP_0_TORQUE", 100)),
    "rmd": (("speed_kp", 95), ("acceleration", 700)),
}
BOTH = pytest.mark.parametrize("protocol", PROTOCOLS)
PATIENT = {"st": (), "rmd": ("--timeout", "500ms")}


def changed(text, values):
    """The text of a file with other values."""
    for name, value in dict(values).items():
        (line,) = (line for line in text.splitlines() if line.startswith(f"{name} = "))
        value, mark, comment = f"{name} = {value}", *line.partition("#")[1:]
        text = text.replace(f"{line}\n", f"{value:30}  {mark}{comment}\n" if mark else f"{value}\n")
    return text


@pytest.fixture
def motor(run, sim):
    """`motor(protocol)` serves drives and gives a function that runs a command for motor 1."""

    def motor(protocol, *arguments):
        drives = sim(*arguments, st=("pty",) if protocol == "st" else (), rmd=("slcan-pty",) if protocol == "rmd" else ())
        port = drives.port("pty" if protocol == "st" else "slcan")
        return lambda *words, **options: run(protocol, "-p", port, *PATIENT[protocol], *words, **options)

    return motor


@BOTH
def test_a_dump_is_changed_restored(motor, tmp_path, protocol):
    command, values = motor(protocol), PROTOCOLS[protocol]
    file, other = tmp_path / "motor1.toml", tmp_path / "other.toml"
    said = command("dump", file).ended(0)
    assert re.fullmatch(rf"\d+ settings of motor 1 are in {file}\n", said.out)
    before = file.read_text()
    assert command("dump").ended(0).out == before == command("dump", "-").ended(0).out
    assert command("diff", file).ended(0).out == f"motor 1 has the settings of {file}\n"

    other.write_text(changed(before, values))
    shown = command("diff", other).ended(1)
    assert f"error: motor 1 differs from {other} in 2 settings" in shown.err
    assert [line.split()[0] for line in shown.out.splitlines()] == ["setting", *dict(values)]
    assert [line.split()[2] for line in shown.out.splitlines()[1:]] == [str(value) for _, value in values]
    done = command("restore", other).ended(0).out
    assert done == shown.out + "motor 1: 2 settings written and read back\n"
    assert command("dump").ended(0).out == changed(before, values)
    assert command("restore", "-", stdin=before).ended(0).out.endswith("2 settings written and read back\n")
    assert command("dump").ended(0).out == before
    assert command("restore", file).ended(0).out == f"motor 1 has the settings of {file}\n"


@BOTH
def test_json_has_the_old_and_the_new_values(motor, tmp_path, protocol):
    command, values = motor(protocol), dict(PROTOCOLS[protocol])
    file = tmp_path / "motor1.toml"

    def told(*words, code=0):
        done = command(*words, "--json").ended(code)
        assert all(line["motor"] == 1 and line["port"] for line in check(done.out))
        return done.lines, check(done.err)

    (dumped,), _ = told("dump")
    assert values.keys() <= dumped["values"].keys()
    (written,), _ = told("dump", file)
    assert (written["ok"], written["file"], written["values"]) == (True, str(file), dumped["values"])
    (same,), _ = told("diff", file)
    assert (same["same"], "values" in same) == (True, False)
    file.write_text(changed(file.read_text(), values))
    (differs,), (failed,) = told("diff", file, code=1)
    assert failed["error"]["kind"] == "differs" and differs["same"] is False
    assert told("restore", file, "--dry-run")[0] == [differs]
    (shown, done), _ = told("restore", file)
    assert (shown["same"], shown["file"], done["ok"]) == (False, str(file), True)
    assert shown["values"] == done["before"] == {name: dumped["values"][name] for name in values}
    assert shown["wanted"] == done["values"]
    assert {name: value["value"] for name, value in done["values"].items()} == values


def test_a_dry_run_writes_nothing(motor, tmp_path):
    command = motor("rmd")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, PROTOCOLS["rmd"]))
    told = command("restore", file, "--dry-run").ended(0)
    assert told.out == command("diff", file).ended(1).out and told.err == "nothing was written\n"
    assert command("dump").ended(0).out == before


def test_a_file_is_replaced_on_request_only(run, tmp_path):
    dump = ("rmd", "-p", "sim:", "--timeout", "500ms", "dump")
    file = tmp_path / "motor1.toml"
    file.write_text("mine")
    told = run(*dump, file).ended(2)
    assert f"`{file}` exists; nothing was written; add --overwrite to replace it" in told.err
    assert file.read_text() == "mine"
    run(*dump, file, "--overwrite").ended(0)
    assert file.read_text() == run(*dump).ended(0).out
    assert "cannot write" in run(*dump, tmp_path / "none" / "motor1.toml").ended(3).err


def test_rom_is_written_with_write_rom_only(motor, tmp_path):
    command = motor("rmd")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, {"speed_kp": 95, "encoder_offset": 100}))
    told = command("restore", file, "--dry-run").ended(2)
    assert "encoder_offset is in the ROM of the motor" in told.err and "add --write-rom to allow it" in told.err
    command("restore", file).ended(2)
    assert command("dump").ended(0).out == before
    done = command("restore", file, "--write-rom").ended(0).out
    assert "2 settings written and read back; written to the ROM: position_kp, " in done
    assert command("dump").ended(0).out == file.read_text()


def test_a_motor_that_turns_is_restored_on_request_only(motor, tmp_path):
    command = motor("st")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, PROTOCOLS["st"]))
    command("start").ended(0)
    told = command("restore", file).ended(1)
    assert "nothing was written; stop it first: `motorlink" in told.err and "or add --running" in told.err
    assert command("dump").ended(0).out == before
    command("restore", file, "--running").ended(0)
    assert command("dump").ended(0).out == file.read_text()


def test_a_file_that_is_not_for_this_motor_is_refused(motor, tmp_path):
    command = motor("st")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    for (old, new), code, said in (
        (('"spec"', '"mcsdk-5.4"'), 2, "line 7: the settings are those of profile `mcsdk-5.4`, and the profile is `spec`; nothing was sent; add --profile mcsdk-5.4"),
        (("SPEED_KI_DIV = 256", "SPEED_KI_DIV = 128"), 2, "SPEED_KI_DIV is 128 in the file and 256 in the motor"),
        (("SPEED_KD = 0", "OBSERVER_CR_C1 = 1"), 1, "drives that are built with: state observer with CORDIC; remove the line"),
        (("SPEED_KD = 0", "OBSERVER_CR_C1 = 1\nOBSERVER_CR_C2 = 1"), 1, "error: OBSERVER_CR_C1, OBSERVER_CR_C2 of /"),
        (("SPEED_KD = 0", "OBSERVER_CR_C1 = 1\nOBSERVER_CR_C2 = 1"), 1, "remove these lines if the drive does not have these settings"),
        (("SPEED_KD = 0", "TORQUE_REF = 1"), 2, "line 14: TORQUE_REF is a register but not a setting: a write could turn the motor or charge a bus; nothing was sent; remove the line, and use `motorlink st"),
    ):  # fmt: skip
        text = changed(before, {"FF_2": 5}).replace(old, new, 1)
        assert text != before
        file.write_text(text)
        told = command("restore", file).ended(code).err
        assert said in told, told
    file.write_text(changed(before, {"FF_2": 5, "REVUP_1_SPEED": 1500}))
    told = command("--speed-limit", 1200, "restore", file).ended(2)
    assert "1200" in told.err and "nothing was" in told.err
    assert "more than 1 MiB" in command("restore", "/dev/zero").ended(2).err
    assert command("dump").ended(0).out == before


@pytest.mark.parametrize(
    "words, said",
    [
        ("st --full-scale 16 dump", "leave out --full-scale"),
        ("st --raw diff x.toml", "leave out --raw"),
        ("rmd --gear-ratio 6 dump", "leave out --gear-ratio"),
        ("rmd --encoder-bits 14 dump", "leave out --encoder-bits"),
        ("rmd --id 1,2 dump", "give one --id"),
        ("rmd --id 1,2 restore x.toml", "give one --id"),
        ("rmd diff /nothing/there.toml", "cannot read `/nothing/there.toml`: No such file or directory (os error 2); nothing was sent; `motorlink rmd -p sim: dump /nothing/there.toml` writes such a file"),
    ],
)
def test_options_that_have_no_meaning_for_a_file_are_refused(run, words, said):
    protocol, *rest = words.split()
    assert said in run(protocol, "-p", "sim:", *rest).ended(2).err


#: Settings of an ST motor whose restore is cut: enough of them that some are written and some are not.
MANY = {"SPEED_KP": 1, "SPEED_KI": 2, "TORQUE_KP": 3, "TORQUE_KI": 4, "FF_2": 5}
OF_MANY = '[st]\nprofile = "spec"\n[st.settings]\n' + "".join(f"{name} = {it}\n" for name, it in MANY.items())


def test_a_cable_that_is_pulled_leaves_the_state_that_the_message_says(run, sim, tmp_path):
    address = sim(st=("tcp",), rmd=()).st_address
    file = tmp_path / "motor1.toml"
    file.write_text(OF_MANY)
    writes = []
    with Line(f"socket://{address}") as line:

        def passed_on(request):
            reply = line.ask(request)
            writes.extend([request] if request[0] == header(SET_REG, 1) else [])
            return reply if len(writes) < 4 else None

        with device(tmp_path / "cable", passed_on) as cable:
            told = run("st", "-p", cable, "restore", file, "--json").ended(3)
    check(told.out + told.err)
    state = told.lines[-1]
    assert (state["ok"], state["changed"], state["unknown"]) == (False, ["SPEED_KP", "SPEED_KI", "TORQUE_KP"], ["TORQUE_KI"])
    message = state["error"]["message"]
    assert "as in the file: SPEED_KP, SPEED_KI, TORQUE_KP" in message and "unknown, old or new: TORQUE_KI" in message
    assert "diff" in state["error"]["try"]
    # The drive is as the message says, and `diff` shows the rest.
    motor = ("st", "-p", f"tcp:{address}")
    assert list(run(*motor, "diff", file, "--json").ended(1).json["values"]) == ["FF_2"]
    run(*motor, "restore", file).ended(0)
    run(*motor, "diff", file).ended(0)


#: Requests of a restore of MANY: a read, the third write, and what puts the second setting back.
READS_SPEED_KP, WRITES_TORQUE_KP, PUTS_SPEED_KI_BACK = "220105", "2103090300", "2103065900"


@pytest.fixture
def held_restore(run, start, sim, tmp_path):
    """`held_restore(request..)`: a restore that waits for the reply to the first of these requests.

    Gives it, a function that hands such a reply on, one that runs commands, the file, the settings before it.
    """
    port, file = sim(rmd=()).st, tmp_path / "motor1.toml"

    def command(*words):
        return run("st", "-p", port, *words)

    with ExitStack() as stack:

        def held_restore(*requests):
            waiting, came, handed_on = list(requests), threading.Event(), threading.Semaphore(0)
            before = command("dump").ended(0).out
            file.write_text(OF_MANY)
            line = stack.enter_context(Line(port))

            def passed_on(request):
                reply = line.ask(request)
                if waiting and request.hex().startswith(waiting[0]):
                    del waiting[0]
                    came.set()
                    handed_on.acquire(timeout=60)
                return reply

            cable = stack.enter_context(device(tmp_path / "cable", passed_on))
            stack.callback(handed_on.release, 9)
            restore = start("st", "-p", cable, "--timeout", "5s", "--trace", "restore", file)
            assert came.wait(60), restore.err
            return restore, handed_on.release, command, file, before

        yield held_restore


def test_after_kill_the_difference_shows_what_was_not_written(held_restore):
    restore, _, command, file, _ = held_restore(WRITES_TORQUE_KP)
    restore.kill()
    shown = command("diff", file, "--json").ended(1).json
    # The third has arrived.
    assert list(shown["values"]) == [*MANY][3:]
    command("restore", file).ended(0)
    command("diff", file).ended(0)


PUTTING_BACK = "putting the old values back; another Ctrl-C leaves the settings mixed"


def test_ctrl_c_puts_the_old_values_back(held_restore):
    restore, hand_on, command, file, before = held_restore(WRITES_TORQUE_KP)
    restore.interrupt()
    restore.says(PUTTING_BACK)
    hand_on()
    assert restore.wait(within=30) == 130
    (said,) = [line for line in restore.err if line.startswith("interrupted")]
    assert "rolled back to the old values: SPEED_KP, SPEED_KI, TORQUE_KP" in said
    assert command("dump").ended(0).out == before


def test_a_second_ctrl_c_names_the_settings_that_are_mixed(held_restore):
    restore, hand_on, command, file, before = held_restore(WRITES_TORQUE_KP, PUTS_SPEED_KI_BACK)
    restore.interrupt()
    restore.says(PUTTING_BACK)
    hand_on()
    restore.until(lambda: sum("SET_REG SPEED_KI" in line for line in restore.err) == 2, "its roll-back")
    restore.interrupt()
    # A thread takes signals, and nothing shows when it has taken this one.
    time.sleep(1)
    hand_on()
    assert restore.wait() == 130
    (said,) = [line for line in restore.err if line.startswith("interrupted")]
    assert "unknown, old or new: SPEED_KI; as in the file: SPEED_KP; all others are as before" in said
    assert "rolled back to the old values: TORQUE_KP" in said
    assert f"diff {file}` shows what differs" in said
    # The message is right.
    left = command("diff", file, "--json").ended(1).json["values"]
    assert {"SPEED_KP", "TORQUE_KP"} & left.keys() == {"TORQUE_KP"}


def test_a_third_ctrl_c_ends_a_restore_that_waits_for_a_reply(start, tmp_path):
    file = tmp_path / "motor1.toml"
    file.write_text('[st]\nprofile = "spec"\n[st.settings]\nSPEED_KP = 9\n')
    answer = drive(lambda: value(700), lambda _: None)
    # No write is answered.
    with device(tmp_path / "st0", lambda request: b"" if request[0] == header(SET_REG, 1) else answer(request)) as port:
        slow = start("st", "-p", port, "--timeout", "60s", "--trace", "restore", file)
        slow.says("SET_REG SPEED_KP")
        slow.interrupt()
        slow.says(PUTTING_BACK)
        slow.interrupt()
        # Another signal: two of a kind that come at once are one.
        slow.process.terminate()
        assert slow.wait() == 130
    assert slow.err[-1] == f"interrupted; the roll-back did not end; `motorlink st -p {port} diff {file}` shows what differs"


def test_ctrl_c_before_the_first_write_changes_nothing(held_restore):
    restore, hand_on, *_ = held_restore(READS_SPEED_KP)
    restore.interrupt()
    time.sleep(1)
    hand_on()
    assert restore.wait() == 130
    # The trace may come behind it.
    assert "interrupted; nothing was changed" in restore.err
    assert not any("SET_REG" in line for line in restore.err)
