"""Random histories of programs and pages on the built product, against a model of who owns which motor.

The model is written from docs/SAFETY.md: after each step the drives do what it says, and nobody else was told
to stop. MODEL=300 pytest tests/e2e/test_owners.py    plays more histories.
"""

import json
import os
import random
import signal
import subprocess
import sys

import pytest

from monitoring import Page, Site
from program import eventually
from sharing import Client

HISTORIES = int(os.environ.get("MODEL", "30"))
#: Histories are divided among so many tests.
TESTS = 3
STEPS = 10
#: The motors of the node, and one behind a guard.
ST, ONE, TWO, GUARDED = MOTORS = (("st0", 1), ("rmd0", 1), ("rmd0", 2), ("guarded", 1))
#: A deadline that a live program keeps on a busy machine.
DEADLINE = "2s"

#: A program that does what it reads. Its last words are those of the process.
PROGRAM = """
import contextlib, json, sys
import motorlink

on_close, *ports = sys.argv[1:]
with contextlib.ExitStack() as stack:
    clients = {}
    for port in ports:
        name, _, port = port.partition("=")
        if name == "st0":
            client = motorlink.st.open(port, on_close="nothing" if on_close == "nothing" else "stop")
        else:
            client = motorlink.rmd.open(port, on_close=on_close, timeout=2)
        clients[name] = stack.enter_context(client)
    print("ready", flush=True)
    for line in sys.stdin:
        what, name, number = json.loads(line)
        if what == "end":
            break
        motor = clients[name].motor(number)
        try:
            match what, name:
                case "start", "st0": motor.set_ramp(1500, 0.1); motor.start()
                case "change", "st0": motor.set_ramp(1200, 0.1)
                case "start" | "change", _: motor.set_speed(360)
                case ("stop", _) | ("off", "st0"): motor.stop()
                case "off", _: motor.off()
                case "read", "st0": motor.status()
                case "read", _: motor.motion_status()
            said = ""
        except motorlink.MotorlinkError as error:
            said = f"{type(error).__name__}: {error}"
        print(json.dumps(said), flush=True)
"""


class Program:
    """A process with the Python package, on ports of a share, a node or a guard."""

    def __init__(self, ending, **ports):
        words = [sys.executable, "-c", PROGRAM, ending, *(f"{name}={port}" for name, port in ports.items())]
        self.ending = ending
        #: Whether it takes each motor from other programs before it moves it for the first time.
        self.takes, self.taken = "take" in next(iter(ports.values())), set()
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "ready\n"
        self.name = str(self.process.pid)

    def does(self, what, motor=("", 0)):
        """The error of a request; empty if there is none."""
        self.process.stdin.write(json.dumps([what, *motor]) + "\n")
        self.process.stdin.flush()
        return "" if what == "end" else json.loads(self.process.stdout.readline())

    def ends(self, how):
        """Ends it in this way."""
        if how == "end":
            self.does("end")
        for number in {"kill": [9], "interrupt": [2], "two signals": [2, 15]}.get(how, []):
            self.process.send_signal(number)
        self.process.wait(20)
        self.process.stdin.close()
        self.process.stdout.close()

    def freezes(self, goes_on):
        self.process.send_signal(signal.SIGSTOP)
        goes_on()
        self.process.send_signal(signal.SIGCONT)


class Browser:
    """A page of the monitor."""

    ending, takes = "stop", False

    def __init__(self, site):
        self.page = eventually(lambda: self._opened(site), "a page of the share")
        self.name = f"{self.page.welcome['name']} (control)"

    @staticmethod
    def _opened(site):
        """A page, if the monitor has found the share."""
        page = Page(site.open())
        if page.alive().ask("lines")["kind"] == "answer":
            return page
        page.leave()
        return None

    def does(self, what, motor):
        line, number = motor
        if what in ("stop", "off"):
            answer = self.page.ask("stop", motor={"line": line, "motor": number})
            return "" if answer["kind"] == "answer" else answer["message"]
        acts = [("set_speed", {"speed_dps": 360})]
        if motor == ST:
            acts = [("SET_RAMP", {"speed_rpm": 1500, "duration_ms": 100})]
            acts += [("START_MOTOR", {})] if what == "start" else []
        said = ""
        for command, values in acts:

            def is_done():
                nonlocal said
                answer = self.page.act(line, number, command, **values)
                said = "" if answer["kind"] == "answer" else answer["message"]
                # The page may not know of a stop yet, or its signs of life may just have begun again.
                return answer["kind"] == "answer" or answer["reason"] not in ("overtaken", "lapsed", "expired")

            eventually(is_done, f"{command} of a page")
        return said

    def ends(self, how):
        if how == "end":
            self.page.leave()
        else:
            self.page.vanish()

    def freezes(self, goes_on):
        self.page.lives = False
        goes_on()
        self.page.lives = True


class Model:
    """What docs/SAFETY.md says of these motors."""

    def __init__(self):
        self.does = dict.fromkeys(MOTORS, "rests")
        self.owner = dict.fromkeys(MOTORS)
        self.is_held = dict.fromkeys(MOTORS, False)
        self.is_latched = False
        #: Motors to which a stop was sent in this step.
        self.told = set()

    def moves(self, program, motor):
        self.does[motor], self.owner[motor], self.is_held[motor] = "turns", program, False

    def stops(self, motor):
        """A stop, as the share sends it."""
        self.told.add(motor)
        self.is_held[motor] = True
        if motor == ST:
            self.does[motor], self.owner[motor] = "rests", None
        elif self.does[motor] == "turns":
            self.does[motor] = "holds"

    def switches_off(self, motor):
        if motor == ST:
            return self.stops(motor)
        self.told.add(motor)
        self.does[motor], self.owner[motor] = "rests", None

    def gone(self, program, lines=("st0", "rmd0", "guarded")):
        for motor in (it for it in MOTORS if it[0] in lines):
            # On a port of one's own and behind a guard, nothing is done with a motor that holds.
            if self.owner[motor] is not program or motor == GUARDED and self.is_held[motor]:
                continue
            if motor == GUARDED or program.ending == "stop":
                self.stops(motor)
            elif program.ending == "off":
                self.switches_off(motor)
            self.owner[motor] = None

    def lapsing(self, program):
        """The lines where it lapses when it gives no sign of life. A page has one session for all lines."""
        turning = {it[0] for it in MOTORS if self.owner[it] is program and not self.is_held[it]}
        if program.ending == "nothing":
            return set()
        return {"st0", "rmd0"} if turning and isinstance(program, Browser) else turning


class World:
    """A node, which is a share, too; a monitor of it; a guard. The drives say what they do."""

    def __init__(self, nodes, sim, start, tmp_path):
        # A motor stays with its program as long as it turns.
        config = tmp_path / "owns.toml"
        config.write_text("lease_seconds = 0.0\n")
        self.start_node = lambda: nodes("owns", "--config", config)
        self.node = self.start_node()
        guarded = sim(st=[], rmd=[f"slcan-pty:{tmp_path}/guarded"])
        self.drives = {"guarded": guarded, "rmd0": self.node.drives, "st0": self.node.drives}
        self.guard = f"{tmp_path}/guard"
        words = ["-p", f"slcan:{tmp_path}/guarded", "--serve", f"unix-listen:{self.guard}"]
        start("guard", "rmd", *words).line(0)
        words = ["--listen", "127.0.0.1:0", "--share", f"unix:{self.node.path}", "--deadline", DEADLINE]
        self.site = Site(json.loads(start("monitor", *words, "--json").line(0)))
        self.model, self.programs = Model(), [None] * 4
        self.looks = Client(self.node.path, "looks")
        self.events()

    def joins(self, kind, ending):
        """The program at this place, which begins now."""
        path, address = self.node.path, self.node.address
        share = f"share:{path}/%s?deadline={DEADLINE}"
        node = f"zenoh:owns/%s?deadline={DEADLINE}&via={address}&take"
        match kind:
            case 0: return Program(ending, st0=share % "st0", rmd0=share % "rmd0")
            case 1: return Program(ending, st0=node % "st0", rmd0=node % "rmd0")
            case 2: return Browser(self.site)
            case _: return Program("stop", guarded=f"slcan:unix:{self.guard}")

    def restarts(self):
        """The node is killed and started again. Its motors turn on without an owner."""
        self.node.kill()
        for at, program in enumerate(self.programs[:3]):
            if program:
                program.ends("kill")
            self.programs[at] = None
        self.node = self.start_node()
        self.looks = Client(self.node.path, "looks")
        model = self.model
        for motor in (ST, ONE, TWO):
            model.owner[motor], model.is_held[motor] = None, False
            if model.is_latched:
                # The monitor latches the next share, and stops all motors that its lines can have.
                model.stops(motor)
        if model.is_latched:
            model.told.update((line, number) for line in ("st0", "rmd0") for number in range(1, 33))
            eventually(lambda: self.looks.ask("lines").get("latched_by"), "the latch of the monitor")

    def does(self, motor):
        """What a motor does; None between two of them."""
        line, number = motor
        for bench in self.drives[line].do("state")["state"]:
            for it in bench["motors"]:
                if it["motor"] == number and ("status" in it) == (motor == ST):
                    rest = {"IDLE": "rests", "RUN": "turns", "off": "rests", "stopped": "holds"}
                    return rest.get(it.get("status") or it["mode"], "turns" if motor != ST else None)
        raise AssertionError(motor)

    def events(self):
        """What the share has said since the last call."""
        for line, motor in (ST, ONE):
            # The share says what its engines have found before it answers this.
            assert self.looks.ask("confirm", line=line, motor=motor)["kind"] == "answer"
        events = [it for it in self.looks.others if isinstance(it, dict) and it["kind"] == "event"]
        self.looks.others.clear()
        return events

    def agrees(self, done):
        """Waits until the motors do what the model says, and nothing else was stopped."""
        model = self.model
        try:
            eventually(lambda: all(self.does(it) == model.does[it] for it in MOTORS), "agreement", within=20)
            events = self.events()
            told = {(it["line"], it["motor"]) for it in events if it["event"] == "stopping"}
            wrong = told - model.told
            assert not wrong, f"{wrong} was stopped: {[it['message'] for it in events]}"
            lapsed = [it["message"] for it in events if it["event"] == "left" and "no sign of life" in it["message"]]
            return lapsed
        except AssertionError as error:
            does = {it: self.does(it) for it in MOTORS}
            raise AssertionError(f"{error}\n" + "\n".join(done) + f"\nthe motors: {does}, not {model.does}") from None
        finally:
            model.told = set()


def moves(world, program, motor, what):
    """A request that starts or changes a motion."""
    model = world.model
    # START_MOTOR of a motor that turns is refused.
    turns = model.does[motor] == "turns" and (motor == ST or what == "change")
    if program.takes and motor not in program.taken:
        program.taken.add(motor)
        model.owner[motor] = model.owner[motor] and program
    is_of_another = model.owner[motor] not in (None, program) and not model.is_held[motor]
    said = program.does("change" if turns else "start", motor)
    if motor != GUARDED and (is_of_another or model.is_latched):
        assert "who holds it" in said or "latch" in said, said
    else:
        assert said == "", said
        model.moves(program, motor)


def step(world, draws):
    """One step of the world and of the model. Gives what it was."""
    model, at = world.model, draws.randrange(4)
    motors = [GUARDED] if at == 3 else [ST, ONE, TWO]
    motor, what = draws.choice(motors), draws.choice(WHATS)
    said = ""
    if what == "restart":
        world.restarts()
        return "the node is killed and started again"
    if world.programs[at] is None:
        world.programs[at] = world.joins(at, draws.choice(("stop", "off", "nothing")))
        said = f"{at} joins, {world.programs[at].ending}; "
    program = world.programs[at]
    said += f"{at}: {what} {motor}"
    if what in ("start", "change"):
        moves(world, program, motor, what)
    elif what in ("stop", "off"):
        assert program.does(what, motor) == ""
        off = what == "off" and isinstance(program, Program)
        model.switches_off(motor) if off else model.stops(motor)
    elif what == "stop of another":
        motor = draws.choice([ST, ONE, TWO])
        said += f", {motor}"
        assert world.looks.ask("stop", motor={"line": motor[0], "motor": motor[1]})["kind"] == "answer"
        model.stops(motor)
    elif what == "latch":
        assert world.looks.ask("release" if model.is_latched else "latch")["kind"] == "answer"
        model.is_latched = not model.is_latched
    elif what == "freeze" and at != 3:
        lapsing = model.lapsing(program)

        def goes_on():
            if lapsing:
                model.gone(program, lapsing)
                assert any(program.name in it for it in world.agrees([said])), f"{said}: nobody lapsed"

        program.freezes(goes_on)
        if lapsing and isinstance(program, Program):
            # A stop would be sent again.
            error = program.does("read", ST if "st0" in lapsing else ONE)
            assert error.startswith("PortError"), error
            program.ends("kill")
            world.programs[at] = None
            model.gone(program)
    elif what in ("end", "kill", "interrupt", "two signals"):
        program.ends(what)
        world.programs[at] = None
        model.gone(program)
    return said


WHATS = [
    "start", "start", "start", "start", "change", "change", "stop", "off", "stop of another", "latch", "freeze", "end",
    "kill", "kill", "interrupt", "two signals", "restart",
]


@pytest.mark.parametrize("part", range(TESTS))
def test_random_histories_end_as_the_model_says(nodes, sim, start, tmp_path, part):
    world = World(nodes, sim, start, tmp_path)
    try:
        for seed in range(part, HISTORIES, TESTS):
            draws, done = random.Random(seed), [f"history {seed}"]
            for _ in range(STEPS):
                done.append(step(world, draws))
                world.agrees(done)
    finally:
        for program in filter(None, world.programs):
            program.ends("kill")
