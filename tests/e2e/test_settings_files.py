"""Settings as text: `dump`, `diff` and `restore` of both protocols, and what is left of a restore that fails."""

import re
import socket
import threading

import pytest

from peers import device
from program import eventually
from st_wire import SET_REG, header
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
    dumped = command("dump", "--json").ended(0).json
    assert values.keys() <= dumped["values"].keys()
    written = command("dump", file, "--json").ended(0).json
    assert (written["ok"], written["file"], written["values"]) == (True, str(file), dumped["values"])
    same = command("diff", file, "--json").ended(0).json
    assert (same["same"], "values" in same) == (True, False)
    file.write_text(changed(file.read_text(), values))
    shown, done = command("restore", file, "--json").ended(0).lines
    assert (shown["same"], shown["file"], done["ok"]) == (False, str(file), True)
    assert shown["values"] == done["before"] == {name: dumped["values"][name] for name in values}
    assert shown["wanted"] == done["values"]
    assert {name: value["value"] for name, value in done["values"].items()} == values
    file.write_text(changed(file.read_text(), {next(iter(values)): 3}))
    failed = command("diff", file, "--json").ended(1)
    assert '"kind":"differs"' in failed.err and failed.json["same"] is False


@BOTH
def test_a_dry_run_writes_nothing(motor, tmp_path, protocol):
    command = motor(protocol)
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, PROTOCOLS[protocol]))
    told = command("restore", file, "--dry-run").ended(0)
    assert told.out == command("diff", file).ended(1).out and told.err == "nothing was written\n"
    assert command("dump").ended(0).out == before


def test_a_file_is_replaced_on_request_only(motor, tmp_path):
    command = motor("rmd")
    file = tmp_path / "motor1.toml"
    file.write_text("mine")
    told = command("dump", file).ended(2)
    assert f"`{file}` exists; nothing was written; add --overwrite to replace it" in told.err
    assert file.read_text() == "mine"
    command("dump", file, "--overwrite").ended(0)
    assert file.read_text() == command("dump").ended(0).out
    assert "cannot write" in command("dump", tmp_path / "none" / "motor1.toml").ended(3).err


def test_rom_is_written_with_write_rom_only(motor, tmp_path):
    command = motor("rmd")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, {"speed_kp": 95, "encoder_offset": 100}))
    for dry in ((), ("--dry-run",)):
        told = command("restore", file, *dry).ended(2)
        assert "encoder_offset is in the ROM of the motor" in told.err and "add --write-rom to allow it" in told.err
        assert command("dump").ended(0).out == before
    done = command("restore", file, "--write-rom").ended(0).out
    assert "2 settings written and read back; written to the ROM: position_kp, " in done
    assert command("dump").ended(0).out == file.read_text()


@BOTH
def test_a_motor_that_turns_is_restored_on_request_only(motor, tmp_path, protocol):
    command = motor(protocol)
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, PROTOCOLS[protocol]))
    if protocol == "st":
        command("start").ended(0)
    else:
        command("speed", 360).ended(0)
        eventually(lambda: command("--json", "status").values["speed"] > 90, "the motor turns")
    told = command("restore", file).ended(1)
    assert "nothing was written; stop it first: `motorlink" in told.err and "or add --running" in told.err
    assert command("dump").ended(0).out == before
    command("restore", file, "--running").ended(0)
    assert command("dump").ended(0).out == file.read_text()


@pytest.mark.parametrize(
    "change, code, said",
    [
        (("SPEED_KP =", "SPEED_KPP ="), 2, "line 12: there is no setting `SPEED_KPP`; did you mean `SPEED_KP`?"),
        (('"spec"', '"mcsdk-5.4"'), 2, "line 7: the settings are those of profile `mcsdk-5.4`, and the profile is `spec`; nothing was sent; add --profile mcsdk-5.4"),
        (("motor = 1", "motor = 2"), 2, "line 8: the settings are those of motor 2, and this is motor 1"),
        (("[st]", "[rmd]"), 2, "line 6: the settings are those of a motor that speaks `rmd`"),
        (("SPEED_KI_DIV = 256", "SPEED_KI_DIV = 128"), 2, "SPEED_KI_DIV is 128 in the file and 256 in the motor"),
        (("SPEED_KD = 0", "SPEED_KD = 40000"), 2, "SPEED_KD: 40000 s16A/unit is outside -32768 to 32767 s16A/unit"),
        (("SPEED_KD = 0", "SPEED_KP = 0"), 2, "line 14: duplicate key"),
        (("[st.settings]", "[[st.settings]]"), 2, "line 10: `settings` has to be a table"),
        (("SPEED_KD = 0", "SPEED_KD = nan"), 2, "SPEED_KD: NaN s16A/unit is outside -32768 to 32767 s16A/unit"),
        (("SPEED_KD = 0", "SPEED_KD = 99999999999999999999"), 2, "is outside -32768 to 32767 s16A/unit"),
        (("SPEED_KD = 0", "SPEED_KD = '0 A'"), 2, "line 14: SPEED_KD is '0 A', and not a number: write the number alone"),
        (("SPEED_KD = 0", "OBSERVER_CR_C1 = 1"), 1, "drives that are built with: state observer with CORDIC; remove the line"),
        (("SPEED_KD = 0", "OBSERVER_CR_C1 = 1\nOBSERVER_CR_C2 = 1"), 1, "error: OBSERVER_CR_C1, OBSERVER_CR_C2 of /"),
        (("SPEED_KD = 0", "OBSERVER_CR_C1 = 1\nOBSERVER_CR_C2 = 1"), 1, "remove these lines if the drive does not have these settings"),
        (("SPEED_KD = 0", "TORQUE_REF = 1"), 2, "line 14: TORQUE_REF is a register but not a setting: a write could turn the motor or charge a bus; nothing was sent; remove the line, and use `motorlink st"),
        (("SPEED_KD = 0", "DAC_OUT1 = 1"), 2, "DAC_OUT1 is a register but not a setting: it belongs to one measurement"),
        (("SPEED_KD = 0", "SPEED_MEAS = 1"), 2, "SPEED_MEAS is a register but not a setting: it cannot be both read and written; nothing was sent; remove the line"),
    ],
)
def test_a_file_that_is_not_for_this_motor_is_refused(motor, tmp_path, change, code, said):
    command = motor("st")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    text = changed(before, {"FF_2": 5}).replace(*change, 1)
    assert text != before
    file.write_text(text)
    told = command("restore", file).ended(code).err
    assert said in told, told
    assert command("dump").ended(0).out == before


@BOTH
def test_a_file_that_was_cut_off_is_refused(motor, tmp_path, protocol):
    command, (name, value) = motor(protocol), PROTOCOLS[protocol][0]
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    text = changed(before, {name: value})
    for cut, said in {
        text.index(f"{name} =") + len(f"{name} = {value}") - 1: f"{name} ends the file without a line end",
        text.index("settings]") + len("settings]\n"): f"there are no settings below `[{protocol}.settings]`",
        text.index(f"{name} =") + len(name): "key with no value",
        0: f"`[{protocol}]` is missing",
    }.items():
        file.write_text(text[:cut])
        told = command("restore", file).ended(2).err
        assert said in told and "nothing was sent" in told, told
    assert command("dump").ended(0).out == before


@BOTH
def test_a_file_without_an_end_is_refused(motor, protocol):
    assert "more than 1 MiB" in motor(protocol)("restore", "/dev/zero").ended(2).err


@BOTH
def test_line_ends_and_marks_of_other_editors_are_read(motor, tmp_path, protocol):
    command, values = motor(protocol), PROTOCOLS[protocol]
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text("\ufeff" + changed(before, values).replace("\n", "\r\n"), newline="")
    assert command("restore", file).ended(0).out.endswith("2 settings written and read back\n")
    assert command("dump").ended(0).out == changed(before, values)


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


def test_limits_apply_to_files(motor, tmp_path):
    command = motor("st")
    file = tmp_path / "motor1.toml"
    before = command("dump").ended(0).out
    file.write_text(changed(before, {"SPEED_KP": 5, "REVUP_1_SPEED": 1500}))
    told = command("--speed-limit", 1200, "restore", file).ended(2)
    assert "1200" in told.err and "nothing was" in told.err
    assert command("dump").ended(0).out == before


#: Settings of an ST motor whose restore is cut: enough of them that some are written and some are not.
MANY = {"SPEED_KP": 1, "SPEED_KI": 2, "TORQUE_KP": 3, "TORQUE_KI": 4, "FLUX_KP": 5, "FLUX_KI": 6, "FF_2": 7}


class Cable:
    """A cable to a drive at HOST:PORT, which is cut at a request of the test's choice."""

    def __init__(self, address, is_last):
        host, port = address.rsplit(":", 1)
        self.drive = (host, int(port))
        self.is_last = is_last
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"tcp:127.0.0.1:{self.listener.getsockname()[1]}"
        self.thread = threading.Thread(target=self.carry, daemon=True)
        self.thread.start()

    def carry(self):
        client, _ = self.listener.accept()
        # A second connection is refused.
        self.listener.close()
        with client, socket.create_connection(self.drive) as drive:
            back = threading.Thread(target=self.pass_back, args=(drive, client), daemon=True)
            back.start()
            while request := client.recv(4096):
                drive.sendall(request)
                if self.is_last(request):
                    break
            drive.shutdown(socket.SHUT_RDWR)
            client.shutdown(socket.SHUT_RDWR)
            back.join()

    @staticmethod
    def pass_back(drive, client):
        try:
            while reply := drive.recv(4096):
                client.sendall(reply)
        except OSError:
            pass


def test_a_cable_that_is_pulled_leaves_the_state_that_the_message_says(run, sim, tmp_path):
    port = f"tcp:{sim(st=('tcp',), rmd=()).st_address}"
    file = tmp_path / "motor1.toml"
    before = run("st", "-p", port, "dump").ended(0).out
    file.write_text(changed(before, MANY))
    writes = []

    def is_fourth_write(request):
        if request[0] == header(SET_REG, 1):
            writes.append(request)
        return len(writes) == 4

    cable = Cable(port.removeprefix("tcp:"), is_fourth_write)
    told = run("st", "-p", cable.port, "--timeout", "200ms", "restore", file, "--json", within=60).ended(3)
    check(told.out + told.err)
    state = told.lines[-1]
    assert (state["ok"], state["changed"], state["unknown"]) == (False, ["SPEED_KP", "SPEED_KI", "TORQUE_KP"], ["TORQUE_KI"])
    message = state["error"]["message"]
    assert "as in the file: SPEED_KP, SPEED_KI, TORQUE_KP" in message and "unknown, old or new: TORQUE_KI" in message
    assert "diff" in state["error"]["try"]
    # The drive is as the message says, and `diff` shows the rest.
    shown = run("st", "-p", port, "diff", file, "--json").ended(1).json
    left = list(shown["values"])
    assert left in (["TORQUE_KI", "FLUX_KP", "FLUX_KI", "FF_2"], ["FLUX_KP", "FLUX_KI", "FF_2"])
    run("st", "-p", port, "restore", file).ended(0)
    run("st", "-p", port, "diff", file).ended(0)


def test_a_can_bus_that_is_cut_leaves_the_state_that_the_message_says(run, sim, tmp_path):
    address = sim(st=(), rmd=("tcp",)).can_address
    motor = ("rmd", "-p", f"slcan:tcp:{address}", "--timeout", "500ms")
    file = tmp_path / "motor1.toml"
    before = run(*motor, "dump").ended(0).out
    file.write_text(changed(before, PROTOCOLS["rmd"]))
    # The write of the acceleration is the last that arrives.
    cable = Cable(address, lambda request: b"t141834" in request)
    words = ("rmd", "-p", f"slcan:{cable.port}", "restore", file)
    told = run(*words, within=60).ended(3)
    assert "unknown, old or new: acceleration; as in the file: speed_kp; all others are as before" in told.err
    assert f"diff {file}` shows what differs" in told.err
    left = run(*motor, "diff", file, "--json").json.get("values", {})
    assert left.keys() <= {"acceleration"}
    run(*motor, "restore", file).ended(0)
    run(*motor, "diff", file).ended(0)


def test_after_kill_of_an_rmd_restore_the_difference_shows_the_rest(run, start, sim, tmp_path):
    motor = ("rmd", "-p", sim(st=(), rmd=("slcan-pty",)).port("slcan"), "--timeout", "2s")
    file = tmp_path / "motor1.toml"
    before = run(*motor, "dump").ended(0).out
    file.write_text(changed(before, PROTOCOLS["rmd"]))
    slow = start(*motor, "--trace", "--fault", "delay=100ms", "restore", file)
    slow.says("Write acceleration data to RAM")
    slow.kill()
    left = run(*motor, "diff", file, "--json").json.get("values", {})
    assert left.keys() <= {"acceleration"}
    run(*motor, "restore", file).ended(0)
    assert run(*motor, "dump").ended(0).out == file.read_text()


@pytest.fixture
def slow_restore(run, start, sim, tmp_path):
    """A restore in progress, a function that runs commands, the file, and the settings before it."""

    def slow_restore():
        port = sim(st=("pty",), rmd=()).st
        file = tmp_path / "motor1.toml"
        before = run("st", "-p", port, "dump").ended(0).out
        file.write_text(changed(before, MANY))
        slow = start("st", "-p", port, "--trace", "--fault", "delay=100ms", "restore", file)
        slow.says("SET_REG TORQUE_KP")
        return slow, lambda *words: run("st", "-p", port, *words), file, before

    return slow_restore


def test_after_kill_the_difference_shows_what_was_not_written(slow_restore):
    slow, command, file, _ = slow_restore()
    slow.kill()
    shown = command("diff", file, "--json").ended(1).json
    left = list(shown["values"])
    # It was killed behind the first two; the third may not have arrived.
    assert left in ([*MANY][2:], [*MANY][3:]), left
    command("restore", file).ended(0)
    command("diff", file).ended(0)


PUTTING_BACK = "putting the old values back; another Ctrl-C leaves the settings mixed"


def test_ctrl_c_puts_the_old_values_back(slow_restore):
    slow, command, file, before = slow_restore()
    slow.interrupt()
    slow.says(PUTTING_BACK)
    assert slow.wait(within=30) == 130
    (said,) = [line for line in slow.err if line.startswith("interrupted")]
    assert "rolled back to the old values: SPEED_KP, SPEED_KI, TORQUE_KP" in said
    assert command("dump").ended(0).out == before


def test_ctrl_c_puts_the_old_values_back_until_all_are_read_again(slow_restore):
    slow, command, file, before = slow_restore()
    # The last write, its read-back, and the first register of the last check.
    slow.says(f"SET_REG {[*MANY][-1]}")
    slow.until(lambda: sum("GET_REG SPEED_KP" in line for line in slow.err) == 3, "the last check", within=30)
    slow.interrupt()
    slow.says(PUTTING_BACK)
    assert slow.wait(within=30) == 130
    assert command("dump").ended(0).out == before


def test_a_second_ctrl_c_names_the_settings_that_are_mixed(slow_restore):
    slow, command, file, before = slow_restore()
    slow.interrupt()
    slow.says("SET_REG SPEED_KI")
    slow.until(lambda: sum("SET_REG SPEED_KI" in line for line in slow.err) == 2, "its roll-back")
    slow.interrupt()
    assert slow.wait() == 130
    (said,) = [line for line in slow.err if line.startswith("interrupted")]
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


def test_ctrl_c_before_the_first_write_changes_nothing(run, start, sim, tmp_path):
    port = sim(st=("pty",), rmd=()).st
    file = tmp_path / "motor1.toml"
    before = run("st", "-p", port, "dump").ended(0).out
    file.write_text(changed(before, MANY))
    slow = start("st", "-p", port, "--trace", "--fault", "delay=100ms", "restore", file)
    slow.says("GET_REG SPEED_KP")
    slow.interrupt()
    assert slow.wait() == 130
    assert slow.err[-1] == "interrupted; nothing was changed"
    assert not any("SET_REG" in line for line in slow.err)
