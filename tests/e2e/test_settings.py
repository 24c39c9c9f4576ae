"""What changes a setting has the value before and after: `st set`, `rmd pid`, `acceleration`, `encoder-offset`."""

import pytest

from peers import device, slcan_adapter
from st_wire import ACK, GET_REG, GET_WRITE_ONLY, SET_REG, frame, nack

SPEED_KP = 0x05
GET_BOARD_INFO = 0x06


@pytest.fixture
def st(run, sim):
    port = sim(rmd=()).st
    return lambda *words: run("st", "-p", port, *words)


@pytest.fixture
def rmd(run, sim):
    port = sim(st=(), rmd=("slcan-pty",)).port("slcan")
    return lambda *words: run("rmd", "-p", port, "--timeout", "500ms", *words)


def drive(read, written):
    """A drive's replies. `read()` gives that to GET_REG SPEED_KP, `written(value)` gets each SET_REG."""
    pending = bytearray()

    def reply(request):
        code, register = request[0] & 0x1F, request[2]
        if code == GET_BOARD_INFO:
            return frame(ACK, bytes(32))
        if code == SET_REG:
            written(int.from_bytes(request[3:-1], "little", signed=True))
            return frame(ACK)
        assert code == GET_REG, request.hex(" ")
        return read() if register == SPEED_KP else frame(ACK, bytes(4 if register == 1 else 1))

    def answer(received):
        pending.extend(received)
        replies = b""
        while len(pending) >= 2 and len(pending) >= pending[1] + 3:
            size = pending[1] + 3
            replies += reply(bytes(pending[:size]))
            del pending[:size]
        return replies

    return answer


def value(number):
    return frame(ACK, number.to_bytes(2, "little"))


@pytest.fixture
def set_speed_kp(run, tmp_path):
    """Sets SPEED_KP to 800 on a drive whose reads give `replies` in turn; gives the outcome and what was written."""

    def set_speed_kp(*replies, code):
        left, written = list(replies), []
        link = tmp_path / f"drive{len(list(tmp_path.iterdir()))}"
        with device(link, drive(lambda: left.pop(0), written.append)) as port:
            words = ("--timeout", "500ms", "set", "SPEED_KP", 800)
            return run("st", "-p", port, *words).ended(code), written

    return set_speed_kp


def test_set_has_the_old_and_the_new_value(st):
    st("set", "SPEED_KP", 700).ended(0)
    assert st("set", "SPEED_KP", 800).ended(0).out == "motor 1: SPEED_KP was 700 s16A/unit, is 800 s16A/unit\n"
    done = st("--json", "--raw", "set", "SPEED_KP", -3, "--verify").ended(0).json
    assert (done["before"], done["values"]) == ({"SPEED_KP": {"digits": 800}}, {"SPEED_KP": {"digits": -3}})
    assert "CONTROL_MODE was SPEED (0x1), is TORQUE (0x0)" in st("set", "CONTROL_MODE", "torque").ended(0).out
    told = st("set", "IQ_SPEEDMODE", 5).ended(0).out
    assert "IQ_SPEEDMODE is written; its value is unknown: IQ_SPEEDMODE is write-only" in told
    done = st("--json", "set", "IQ_SPEEDMODE", 5).ended(0).json
    assert done["ok"] and not {"before", "values"} & set(done)


def test_set_writes_nothing_if_the_old_value_cannot_be_read(set_speed_kp):
    # The first two replies of a line that fails are to one request: it is repeated.
    told, written = set_speed_kp(b"", b"", b"", b"", code=3)
    assert "SPEED_KP was not written:" in told.err and written == []


def test_set_says_that_the_write_was_acknowledged_if_the_line_fails_then(set_speed_kp):
    told, written = set_speed_kp(value(700), b"", b"", b"", b"", code=3)
    assert "the drive acknowledged writing SPEED_KP, but it could not be read back:" in told.err
    assert written == [800] and told.out == ""


def test_set_says_that_a_drive_refuses_to_read(set_speed_kp):
    refusal = nack(GET_WRITE_ONLY)
    told, _ = set_speed_kp(value(700), refusal, code=0)
    assert "SPEED_KP was 700 s16A/unit and is written; its new value is unknown:" in told.out
    told, written = set_speed_kp(refusal, value(800), code=0)
    assert "SPEED_KP is 800 s16A/unit; its old value is unknown:" in told.out
    assert written == [800]


def test_set_fails_if_the_drive_has_another_value_then(set_speed_kp):
    told, written = set_speed_kp(value(700), value(750), code=1)
    assert "SPEED_KP should be 800 and reads 750" in told.err and told.out == "" and written == [800]


def test_pid_sets_one_gain_and_leaves_the_others(rmd):
    rmd("pid", 1, 2, 3, 4, 5, 6).ended(0)
    said = rmd("pid", "speed_kp=120").ended(0).out
    assert "speed kp     was 3, is 120" in said and said.count("as before") == 5
    done = rmd("--json", "pid", "torque-ki=7", "POSITION_KP=9").ended(0).json
    assert done["before"]["torque_ki"] == {"value": 6}
    assert [gain["value"] for gain in done["values"].values()] == [9, 2, 120, 4, 5, 7]
    assert list(rmd("--json", "pid").ended(0).values.values()) == [9, 2, 120, 4, 5, 7]


def test_gains_that_make_no_sense_are_not_sent(run):
    for words, said in (
        ("1 2", "2 gains are given, and a motor has six"),
        ("speed=3", "the gains are position_kp, position_ki, speed_kp"),
        ("speed_kp=1 2", "a motor has no gain `2`"),
        ("1 2 3 4 5 256", "a whole number from 0 to 255"),
    ):
        told = run("rmd", "-p", "sim:", "--trace", "pid", *words.split()).ended(2).err
        assert said in told and "#31" not in told


def test_acceleration_and_encoder_offset_have_the_old_and_the_new_value(rmd):
    rmd("acceleration", 9).ended(0)
    assert "was 9 °/s², is 20 °/s²" in rmd("acceleration", 20).ended(0).out
    done = rmd("--json", "acceleration", 9).ended(0).json
    assert (done["before"]["acceleration"]["value"], done["values"]["acceleration"]["value"]) == (20, 9)
    rmd("encoder-offset", 5, "--write-rom").ended(0)
    assert "offset  was 5, is 6" in rmd("encoder-offset", 6, "--write-rom").ended(0).out
    narrow = rmd("--json", "encoder-offset", 60000, "--write-rom").ended(1).json
    assert narrow["before"] == {"offset": {"value": 6}}
    assert "instead of 60000" in narrow["error"]["message"]


@pytest.fixture
def told_by_motor(run, tmp_path):
    """Runs `motorlink rmd` on a motor whose reads of the setting give `replies` in turn, then nothing.

    0x30 and 0x33 read; the writes 0x31 and 0x34 are answered with what was sent."""

    def told_by_motor(words, *replies, code):
        left = list(replies)

        def motor(can):
            command = can[5:7]
            if command in ("30", "33"):
                return [f"t1418{command}00{left.pop(0)}"] if left else []
            return [can] if command in ("31", "34") else [f"t1418{command}1900F000000000"]

        with device(tmp_path / f"can{len(list(tmp_path.iterdir()))}", slcan_adapter(motor)) as path:
            port = ("-p", f"slcan:{path}", "--timeout", "100ms")
            return run("rmd", *port, *words.split()).ended(code)

    return told_by_motor


@pytest.mark.parametrize("words", ["pid speed_kp=9", "acceleration 9"])
def test_a_setting_that_cannot_be_read_is_not_written_or_said_to_be_written(told_by_motor, words):
    assert "not written:" in told_by_motor(words, code=3).err
    told = told_by_motor(words, 6 * "00", code=3)
    assert "the motor confirmed the write, but" in told.err and told.out == ""


def test_another_program_that_changes_gains_in_between_is_told(told_by_motor):
    told = told_by_motor("pid speed_kp=100", "646464096464", "6464640A6464", code=1)
    assert "speed ki is 10 instead of 9" in told.err and "another program changed them" in told.err
