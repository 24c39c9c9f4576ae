"""`motorlink watch` in a terminal, on simulated drives. What motors do is read from the simulator."""

import signal

import pytest

from peers import Plug
from program import PATIENT, eventually
from terminal import Terminal

@pytest.fixture
def bench(sim, run):
    """Drives of both kinds: ST motor 1 and RMD motor 2 turn, when they are told to."""

    class Bench:
        def __init__(self):
            self.sim = sim()
            self.st, self.can = self.sim.st, f"slcan:{self.sim.can}"
            self.ports = ("-p", self.st, "-p", self.can)

        def turn(self):
            run("st", "-p", self.st, *PATIENT, "start").ended(0)
            run("rmd", "-p", self.can, *PATIENT, "--id", 2, "speed", 360).ended(0)
            eventually(lambda: self.speed("st") > 300 and self.speed("rmd") > 10, "two motors that turn")

        def speed(self, kind):
            port, number = {"st": (f"pty:{self.st}", 1), "rmd": (f"slcan-pty:{self.sim.can}", 2)}[kind]
            motor = self.sim.motor(number, port)
            return abs(motor.get("speed_rpm", motor.get("speed_dps")))

        def rests(self):
            eventually(lambda: self.speed("st") < 1 and self.speed("rmd") < 0.1, "motors at rest", 30)

    return Bench()


def test_twelve_motors_have_a_row_each(sim, watch, tmp_path):
    st, rmd = (tmp_path / "st0", tmp_path / "st1"), (tmp_path / "can0", tmp_path / "can1")
    sim(st=[f"pty:{path}" for path in st], rmd=[f"slcan-pty:{path}" for path in rmd])
    ports = [word for path in st for word in ("-p", path)]
    ports += [word for path in rmd for word in ("-p", f"slcan:{path}")]
    terminal = watch(*ports)
    names = [f"st{bus}:{number}" for bus in (0, 1) for number in (1, 2)]
    names += [f"can{bus}:{number}" for bus in (0, 1) for number in (1, 2, 3, 4)]
    terminal.shows("12 motors on 4 ports", *names, "SPACE STOP ALL", "q quit")
    for name in names:
        eventually(lambda: "/10.0" in terminal.line_of(f"{name} "), f"the rate of {name}", 30)
        row = terminal.line_of(f"{name} ")
        assert ("IDLE" if name.startswith("st") else "at rest") in row
        assert "°C" in row and " V " in row and "…" not in row and len(row) <= 80
    terminal.press("q")
    assert terminal.wait() == 0
    eventually(lambda: terminal.is_as_before, "the terminal as before")


def test_stop_all_that_comes_together_with_more_is_taken(bench, watch):
    bench.turn()
    terminal = watch(*bench.ports)
    terminal.shows("RUN")
    # What comes while it is stopped comes together.
    terminal.signal(signal.SIGSTOP)
    terminal.press("j" * 1500)
    terminal.resize(100, 30)
    terminal.press("space")
    terminal.signal(signal.SIGCONT)
    terminal.shows("LATCHED", "stop confirmed")
    bench.rests()


def test_values_are_those_of_the_drives_and_s_stops_the_selected_motor_only(bench, watch):
    bench.turn()
    terminal = watch(*bench.ports, "--rate", 20)
    terminal.shows("RUN", "turning", "360 °/s")
    eventually(lambda: "/20.0" in terminal.line_of("st0:1 "), "the rate")
    terminal.press("s")
    terminal.shows("stop confirmed by 1 of 6: st0:1")
    eventually(lambda: bench.speed("st") < 1, "a motor at rest", 30)
    assert bench.speed("rmd") > 10
    assert "LATCHED" not in terminal.text
    terminal.press("j", "j", "j", "s")
    terminal.shows("stop confirmed by 2 of 6: st0:1 can0:2")
    bench.rests()


def test_a_register_is_written_and_read_back(bench, watch, run):
    terminal = watch(*bench.ports)
    terminal.shows("can0:4")
    terminal.press("r", "/", "SPEED_KP", "enter")
    terminal.shows("SPEED_KP", "s16A/unit")
    terminal.press("e", "7770", "backspace", "enter")
    terminal.shows("is 777 s16A/unit (read back)")
    terminal.press("e", "70000", "enter")
    terminal.shows("NOT WRITTEN", "32767")
    assert terminal.bold("NOT WRITTEN")
    # One that the drive refuses is not edited.
    terminal.press("/", "OBSERVER_CR_C1", "enter")
    terminal.shows("OBSERVER_CR_C1 exists only in drives", "that are built with: state observer with CORDIC")
    terminal.press("e")
    terminal.shows("OBSERVER_CR_C1 cannot be edited: refused: GET_WRITE_ONLY")
    terminal.press("q")
    assert terminal.wait() == 0
    assert "777" in run("st", "-p", bench.st, *PATIENT, "get", "SPEED_KP").ended(0).out


def test_a_gain_and_the_acceleration_are_written_and_read_back(bench, watch, run):
    terminal = watch("-p", bench.can, "--id", 3)
    terminal.shows("can0:3")
    terminal.press("r")
    terminal.shows("position_kp", "acceleration")
    terminal.shows("Kp of the position loop (`anglePidKp`), no unit, 0 to", "255")
    terminal.press("/", "speed_kp", "enter", "e", "77", "enter")
    terminal.shows("speed_kp was", "is 77 (read back)")
    terminal.press("e", "256", "enter")
    terminal.shows("NOT WRITTEN: `256` is not a gain: a gain is a whole number", "from 0 to 255; type the number alone")
    terminal.press("esc")
    terminal.shows_no("with `speed_kp`")
    terminal.press("end", "e", "1500", "enter")
    terminal.shows("is 1500 °/s² (read back)")
    terminal.press("ctrl-c")
    assert terminal.wait() == 0
    assert "77" in run("rmd", "-p", bench.can, *PATIENT, "--id", 3, "pid").ended(0).out


def test_the_help_has_all_keys_and_those_that_are_sequences_do_what_it_says(bench, watch):
    terminal = watch(*bench.ports)
    terminal.shows("can0:4")
    terminal.press("?")
    terminal.shows("any key closes this help", "SPACE ! F12 Ctrl-X", "up down j k", "Enter", "e Enter", "r ", "s ", "u ",
                   "n ", "Esc", "Ctrl-Z", "q Ctrl-C")
    assert "…" not in terminal.text
    terminal.press("esc")
    terminal.shows_no("any key closes this help")
    names = ("st0:1", "st0:2", "can0:1", "can0:2", "can0:3", "can0:4")
    for key, row in (("down", 1), ("up", 0), ("j", 1), ("k", 0), ("end", 5), ("home", 0), ("page-down", 5), ("page-up", 0)):
        terminal.press(key)
        terminal.shows(f">{names[row]}")
    terminal.press("end", "enter")
    terminal.shows("can0:4  at rest", "multi_turn_angle_degrees", "phase_a_amps", "0.00 °")
    terminal.press("r")
    terminal.shows("can0:4  at rest", ">position_kp", "7 of 7 registers")
    terminal.press("/", "torque_k")
    terminal.shows("search: torque_k_", "2 of 7 registers")


def test_motors_that_appear_later_are_found(bench, watch):
    terminal = watch("-p", bench.st, "-p", bench.can, "--motor", 1, "--id", 2)
    terminal.shows("2 motors on 2 ports", "st0:1", "can0:2")
    terminal.press("n")
    terminal.shows("6 motors on 2 ports", "st0: 1 more motors", "can0: 3 more motors")
    for name in ("st0:2", "can0:1", "can0:3", "can0:4"):
        eventually(lambda: "/10.0" in terminal.line_of(f"{name} "), f"the rate of {name}", 30)
    terminal.press("end")
    terminal.shows(">can0:4")
    terminal.press("!")
    terminal.shows("stop confirmed by all 6 motors")


@pytest.fixture
def cable(sim, run):
    """An ST drive whose motor 1 turns, on a cable that can be unplugged."""
    drives = sim(st=("tcp",), rmd=())
    run("st", "-p", f"tcp:{drives.st_address}", *PATIENT, "start").ended(0)
    cable = Plug(drives.st_address)
    cable.speed = lambda: abs(drives.motor(1)["speed_rpm"])
    eventually(lambda: cable.speed() > 300, "a motor that turns")
    yield cable
    cable.unplug()


def test_a_stop_while_the_port_is_gone_is_loud_and_is_repeated_when_it_is_back(cable, watch):
    terminal = watch("-p", cable.port)
    terminal.shows("RUN")
    cable.unplug()
    terminal.shows("PORT GONE", "port gone")
    terminal.press("!")
    loud = "stop NOT CONFIRMED, may still be turning:"
    terminal.shows("LATCHED", loud)
    assert terminal.bold(loud)
    assert cable.speed() > 300
    cable.plug_in()
    eventually(lambda: cable.speed() < 1, "a motor at rest", 30)
    terminal.shows_no(loud)
    terminal.shows("the port is back after", "stop confirmed by all 2 motors", "LATCHED", "°C")


def test_a_stop_that_is_not_confirmed_at_the_end_is_an_error(cable, watch):
    terminal = watch("-p", cable.port)
    terminal.shows("RUN")
    cable.unplug()
    terminal.shows("PORT GONE")
    terminal.press("!", "q")
    assert terminal.wait() == 3
    said = "did not confirm the stop and may still be turning"
    eventually(lambda: said in terminal.text.replace("\n", ""), said)


def test_the_end_waits_for_a_stop_that_is_under_way(bench, watch):
    bench.turn()
    terminal = watch(*bench.ports)
    terminal.shows("RUN", "turning")
    terminal.press("!q")
    assert terminal.wait() == 0
    bench.rests()


def test_the_view_follows_the_size_of_the_terminal_and_a_tiny_one_still_stops_all(bench, watch):
    bench.turn()
    terminal = watch(*bench.ports)
    terminal.shows("got/asked")
    terminal.resize(200, 60)
    eventually(lambda: len(terminal.lines[1]) > 100, "a wide header")
    for columns, lines in ((40, 10), (20, 5), (1, 1), (20, 5)):
        terminal.resize(columns, lines)
        if lines > 1:
            eventually(lambda: terminal.line_of("SPACE STOP ALL"), "the key of the stop")
    terminal.resize(1, 1)
    terminal.press("space")
    bench.rests()
    terminal.resize(80, 24)
    terminal.shows("LATCHED", "got/asked", "can0:4")
    terminal.press("ctrl-c")
    assert terminal.wait() == 0
    eventually(lambda: terminal.is_as_before, "the terminal as before")


def test_a_signal_leaves_the_terminal_as_it_was(bench, watch):
    terminal = watch(*bench.ports)
    terminal.shows("can0:4")
    terminal.signal(signal.SIGTERM)
    assert terminal.wait() == 0
    eventually(lambda: terminal.is_as_before, "the terminal as before")


def is_suspended(terminal):
    with open(f"/proc/{terminal.process.pid}/stat") as stat:
        return stat.read().rpartition(")")[2].split()[0] == "T"


def test_it_can_be_suspended_and_is_drawn_again_after_a_stop_that_it_cannot_handle(bench, watch):
    terminal = watch(*bench.ports)
    terminal.shows("can0:4")
    terminal.signal(signal.SIGSTOP)
    eventually(lambda: is_suspended(terminal), "a stopped program")
    terminal.clear()
    terminal.signal(signal.SIGCONT)
    terminal.shows("6 motors on 2 ports", "can0:4", "q quit")
    terminal.press("ctrl-z")
    eventually(lambda: is_suspended(terminal), "a suspended program")
    eventually(lambda: terminal.is_as_before, "the terminal as before")
    terminal.signal(signal.SIGCONT)
    eventually(lambda: not terminal.is_as_before, "the view again")
    terminal.press("?")
    terminal.shows("any key closes this help")
    terminal.press("q")
    assert terminal.wait() == 0
    eventually(lambda: terminal.is_as_before, "the terminal as before")


def test_motors_that_others_started_go_on_when_it_ends_or_is_killed(bench, watch):
    bench.turn()
    for end in ("q", signal.SIGKILL):
        terminal = watch(*bench.ports)
        terminal.shows("RUN", "turning")
        terminal.press(end) if isinstance(end, str) else terminal.signal(end)
        terminal.wait()
        assert bench.speed("st") > 300 and bench.speed("rmd") > 10


def test_it_ends_when_its_terminal_is_gone(bench, motorlink):
    terminal = Terminal([motorlink, "watch", *bench.ports, "--timeout", "1s"])
    terminal.shows("can0:4")
    terminal.hang_up()
    assert terminal.wait() == 0


def test_without_a_terminal_it_says_what_to_use(run, watch, bench):
    failed = run("watch", "-p", bench.st).ended(2)
    assert "watch needs a terminal" in failed.err and "--every" in failed.err
    terminal = watch("-p", bench.st, TERM="dumb")
    terminal.shows("watch needs a terminal", "--every 100ms")
    assert terminal.wait() == 2


def test_a_port_without_motors_is_an_error(sim, watch):
    port = sim(st=()).can
    terminal = watch("-p", port)
    terminal.shows("no motor answers at")
    assert terminal.wait() == 3
    assert "\x1b[?1049h".encode() not in terminal.raw


def test_colours_are_left_out_on_request(bench, watch):
    bench.sim.do("supply", motor=1, port=f"pty:{bench.st}", volts=5)
    for variables, has_colours in (({}, False), ({"NO_COLOR": None}, True)):
        terminal = watch(*bench.ports, **variables)
        terminal.shows("FAULT_NOW", "UNDER_VOLT")
        assert (b"38;5;1" in terminal.raw) == has_colours, terminal.raw
        assert terminal.bold("UNDER_VOLT")
        terminal.press("q")
        assert terminal.wait() == 0
