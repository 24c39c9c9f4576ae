"""`motorlink node --ros2`, as zenoh-ros2-sdk and rosbags see it.

ROUNDS=30 pytest tests/e2e/test_ros2.py -s    kills and freezes publishers and cuts the network 30 times, with times.
"""

import json
import math
import os
import signal
import struct
import time
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fleeting import Cable, Killed, network
from program import eventually
from sharing import Client, event
from test_node import stands, via

pytest.importorskip("zenoh_ros2_sdk", reason="needs Python 3.10")

from rosbags.highlevel import AnyReader  # noqa: E402
from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from ruamel.yaml import YAML  # noqa: E402

from robot import DIAGNOSTICS, STATE, TRIGGER, Robot  # noqa: E402

ROUNDS = int(os.environ.get("ROUNDS", "1"))
ROS = get_typestore(Stores.ROS2_JAZZY)
LIVE = 0.2
#: A stop lasts until no command has come for this time.
QUIET = 1.0
PERIOD = 0.02
#: An exchange, and what a loaded machine takes.
SLACK = 0.5
RPM = 2 * math.pi / 60
EXAMPLE = Path(__file__).parents[2] / "examples/ros2_control"
FILE = f"""
[ros2]
time_to_live_seconds = {LIVE}

[[ros2.joint]]
name = "wheel"
line = "st0"
motor = 1
command = "velocity"
max_velocity_rad_per_s = 200.0

[[ros2.joint]]
name = "arm"
line = "rmd0"
motor = 2
command = "position"
gear_ratio = 6.0
offset_rad = 0.5
reversed = true
torque_constant_nm_per_a = 2.0
max_velocity_rad_per_s = 1.0

[[ros2.joint]]
name = "watched"
line = "rmd0"
motor = 3
"""


@pytest.fixture
def file(tmp_path):
    """The file of the node."""
    path = tmp_path / "node.toml"
    path.write_text(FILE)
    return path


@pytest.fixture
def node(nodes, file):
    """A node for ROS 2 with the name arm1, a wheel and an arm."""
    return nodes("arm1", "--ros2", "--config", file)


@pytest.fixture
def direct(node):
    """A program at the share of the node, which knows how the motors turn."""
    return Client(node.path, "looks")


@pytest.fixture
def robot(node):
    robot = Robot(node.address)
    yield robot
    robot.close()


@pytest.fixture
def diagnostics(robot):
    """The last status of a part of the node."""
    heard = robot.hears("/diagnostics", DIAGNOSTICS)

    def last(part):
        eventually(lambda: heard, "diagnostics", within=20)
        (status,) = [it for it in heard[-1].status if it.name == f"arm1: {part}"]
        status.details = {it.key: it.value for it in status.values}
        return status

    return last


class Publisher(Killed):
    """A process that publishes commands until it is killed."""

    def __init__(self, node, **message):
        super().__init__("robot.py", node.address, str(PERIOD), json.dumps(message))
        assert self.said == "ready\n"


def turns(direct, rpm=900, within=20):
    eventually(lambda: abs(direct.rpm() - rpm) < 100, "the wheel at speed", within)


@contextmanager
def turning(node, direct):
    """A publisher that turns the wheel: another one if a pause of the machine has ended its motion."""
    for is_last in (False, False, True):
        with Publisher(node, **wheel()) as publisher:
            try:
                turns(direct, within=7)
            except AssertionError:
                if is_last:
                    raise
            else:
                yield publisher
                return
        quiet(direct)


def angle(direct, motor=2):
    """The angle of an RMD motor, by itself, in degrees."""
    return int.from_bytes(direct.read("rmd0", motor, 0x92, *7 * [0])[1:8], "little", signed=True) / 100


def wheel(rpm=900):
    return {"name": ["wheel"], "velocity": [rpm * RPM]}


def quiet(direct):
    """Until no command of an earlier publisher counts."""
    stands(direct)
    time.sleep(QUIET + LIVE)


def test_ros_tools_see_the_topics_and_services_that_the_node_announces(node, robot):
    ready = json.loads(node.out[0])["ros2"]
    assert ready["joints"] == ["wheel", "arm", "watched"]
    topics = dict(robot.sdk.get_topic_names_and_types(**robot.at))
    state = [STATE]
    assert topics["/arm1/joint_states"] == topics["/arm1/joint_commands"] == state
    assert topics["/diagnostics"] == [DIAGNOSTICS]
    assert set(topics) == {*ready["publishes"], *ready["obeys"]}
    services = dict(robot.sdk.get_service_names_and_types(**robot.at))
    assert services == {name: [TRIGGER] for name in ready["services"]}
    assert set(services) == {"/arm1/stop_all", "/arm1/clear_faults"}


def test_rosbags_reads_what_the_drives_say_in_a_recording_of_the_topics(node, direct, tmp_path):
    # RMD motor 2 to 90°, and ST motor 1 to 900 rpm.
    for line, motor, code in [
        ("rmd0", 2, struct.pack("<BxHi", 0xA4, 360, 9000)),
        ("st0", 1, struct.pack("<BiH", 7, 900, 100)),
        ("st0", 1, bytes([3, 1])),
    ]:
        assert direct.command(line, motor, *code)["kind"] == "answer"
    eventually(lambda: abs(angle(direct) - 90) < 0.2 and abs(direct.rpm() - 900) < 20, "motion", within=20)
    at, began, zenoh, heard = angle(direct), time.time(), network(node.address), []
    zenoh.declare_subscriber("0/**", lambda it: heard.append((str(it.key_expr), it.payload.to_bytes(),
                                                              it.attachment.to_bytes())))
    eventually(lambda: len({key for key, *_ in heard}) == 2 and len(heard) > 60, "both topics", within=20)
    zenoh.close()
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {}
        for key, payload, attachment in heard:
            _, *topic, dds, hash = key.split("/")
            kind = dds.replace("::dds_::", "::").replace("::", "/").removesuffix("_")
            assert hash == ROS.hash_rihs01(kind)
            if key not in topics:
                topics[key] = bag.add_connection("/" + "/".join(topic), kind, typestore=ROS)
            _, sent, size = struct.unpack_from("<qqB", attachment)
            assert size == 16 and len(attachment) == 33
            bag.write(topics[key], sent, payload)
    with AnyReader([tmp_path / "bag"]) as bag:
        read = [(it.topic, bag.deserialize(raw, it.msgtype)) for it, _, raw in bag.messages()]
    assert len(read) == len(heard)
    states = [it for topic, it in read if topic == "/arm1/joint_states"]
    # A value that a busy machine could not read lately is none.
    state = next(it for it in reversed(states) if not math.isnan(it.position[1]) and not math.isnan(it.velocity[0]))
    assert state.name == ["wheel", "arm", "watched"]
    assert math.isnan(state.position[0])
    assert state.position[1] == pytest.approx(0.5 - math.radians(at) / 6, abs=0.001)
    assert state.velocity[0] == pytest.approx(900 * RPM, abs=2)
    assert math.isnan(state.effort[0]) and math.isfinite(state.effort[1]) and math.isnan(state.effort[2])
    stamp = state.header.stamp.sec + state.header.stamp.nanosec / 1e9
    assert began - 0.5 < stamp < time.time()
    (arm,) = [it for it in [it for topic, it in read if topic == "/diagnostics"][-1].status if "arm1: arm" in it.name]
    assert (arm.level, arm.message, arm.hardware_id) == (0, "OK", "arm1/rmd0/2")


@pytest.mark.parametrize("how", ["killed", "frozen"])
def test_a_motor_stops_when_its_publisher_is_lost(node, direct, how):
    times, number = [], {"killed": signal.SIGKILL, "frozen": signal.SIGSTOP}[how]
    for _ in range(3 * ROUNDS):
        with turning(node, direct) as publisher:
            direct.others.clear()
            began = time.time()
            publisher.process.send_signal(number)
            quiet(direct)
            stops = [it for it in direct.others if event("stopping", motor=1, by="ros2")(it)]
            # On a busy machine the publisher may have been late just before, so that its motor stopped then.
            times += [it["wall"] - began for it in stops if it["wall"] > began]
        if len(times) >= ROUNDS:
            break
    assert len(times) >= ROUNDS
    print(f"\n{how}, time to live {LIVE} s: {sorted(round(it, 3) for it in times)}")
    assert max(times) < LIVE + SLACK


def test_an_arm_follows_positions_and_stops_with_its_publisher(node, robot, direct):
    states = robot.hears("/arm1/joint_states", STATE)
    command = robot.commands()

    def arm():
        # A joint is there once its motor has answered.
        return dict(zip(states[-1].name, states[-1].position)).get("arm", math.nan) if states else math.nan

    eventually(lambda: math.isfinite(arm()), "a position", within=20)
    began, end = arm(), time.monotonic() + 20
    # A program that has to wait for the machine begins again where the arm is.
    while arm() < began + 0.5:
        assert time.monotonic() < end, states[-1]
        command(name=["arm"], position=[arm() + 0.1])
        time.sleep(PERIOD)
    assert angle(direct) == pytest.approx(math.degrees(0.5 - arm()) * 6, abs=30)
    direct.until(event("stopping", motor=2, by="ros2"))


def test_a_network_that_is_cut_stops_the_motor_and_brings_no_old_motion(node, direct, diagnostics):
    times = []
    for _ in range(3 * ROUNDS):
        before = int(diagnostics("commands").details.get("old", 0))
        with Cable(node) as cable, turning(cable, direct) as publisher:
            began = time.time()
            cable.process.send_signal(signal.SIGSTOP)
            stands(direct)
            is_stop = event("stopping", motor=1, by="ros2")
            stops = [it["wall"] - began for it in direct.others if is_stop(it) and it["wall"] > began]
            direct.others.clear()
            if not stops:
                # A pause of the machine had ended its motion before the cut.
                continue
            times.append(stops[0])
            time.sleep(1.0)
            # It publishes no more; the samples of the last second wait.
            publisher.process.send_signal(signal.SIGUSR1)
            cable.process.send_signal(signal.SIGCONT)
            eventually(lambda: int(diagnostics("commands").details.get("old", 0)) > before, "old samples", within=5)
            time.sleep(0.5)
            assert abs(direct.rpm()) < 30
        if len(times) >= ROUNDS:
            break
    assert len(times) >= ROUNDS
    print(f"\ncut, time to live {LIVE} s: {sorted(round(it, 3) for it in times)}")
    assert max(times) < LIVE + SLACK


def test_a_latch_holds_until_commands_begin_again_and_a_program_that_takes_a_motor_keeps_it(
    node, direct, run, diagnostics
):
    with turning(node, direct):
        run("fleet", "latch", **via(node)).ended(0)
        stands(direct)
        run("fleet", "release", **via(node)).ended(0)
        # It sends on, and is not obeyed.
        time.sleep(0.5)
        assert abs(direct.rpm()) < 30
        eventually(lambda: diagnostics("wheel").level == 2, "a blocked wheel", within=5)
    eventually(lambda: diagnostics("wheel").level == 0, "commands count again", within=5)
    with turning(node, direct):
        taker = Client(node.path, "taker")
        assert taker.ask("take", motor={"line": "st0", "motor": 1})["kind"] == "answer"
        eventually(lambda: "taker" in diagnostics("wheel").message, "who holds it", within=5)
        # The node stops nothing that it does not hold.
        time.sleep(2 * LIVE)
        turns(direct)
        taker.socket.close()
        stands(direct)


def test_a_wheel_stops_at_zero_and_starts_again(node, robot, direct):
    command = robot.commands()
    for rpm in (900, 0, -900, 0):

        def is_there(rpm=rpm):
            command(**wheel(rpm))
            time.sleep(PERIOD)
            return abs(direct.rpm() - rpm) < 60

        eventually(is_there, "the wheel at speed", within=20)


def test_stop_all_stops_motors_and_says_so(node, robot, direct, diagnostics):
    with turning(node, direct):
        response = robot.call("/arm1/stop_all")
        assert response.success and response.message == "all motors confirmed"
        stands(direct)
        # The publisher sends on.
        time.sleep(0.5)
        assert abs(direct.rpm()) < 30
    eventually(lambda: diagnostics("wheel").level == 0, "commands count again", within=5)
    # Another program stops it while no command comes: the publisher may only be late.
    eventually(lambda: direct.ask("stop") and "looks has stopped it" in diagnostics("wheel").message, "a block", within=20)


def test_a_fault_ends_a_motion_until_it_is_cleared_and_commands_begin_again(node, robot, direct, diagnostics):
    sim = node.drives
    fault = {"port": f"pty:{sim.st}", "motor": 1, "fault": "OVER_TEMP"}
    with turning(node, direct):
        sim.do("fault", **fault, hold=True)
        stands(direct)
        eventually(lambda: diagnostics("wheel").level == 2, "an error", within=5)
        assert "OVER_TEMP" in diagnostics("wheel").details["faults"]
        response = robot.call("/arm1/clear_faults")
        assert not response.success and response.message.startswith("st0, motor 1: "), response
        sim.do("fault", **fault, hold=False)
        response = robot.call("/arm1/clear_faults")
        assert response.success and response.message == "all motors confirmed", response
        # The publisher sends on.
        time.sleep(0.5)
        assert abs(direct.rpm()) < 30
    eventually(lambda: diagnostics("wheel").level == 0, "no error", within=5)
    with turning(node, direct):
        pass


def test_the_files_of_the_example_have_the_names_that_the_node_announces(nodes):
    ready = json.loads(nodes("arm1", "--ros2", "--config", EXAMPLE / "node.toml").out[0])["ros2"]
    control = ElementTree.parse(EXAMPLE / "arm.urdf").getroot().find("ros2_control")
    params = {param.get("name"): param.text for param in control.findall("hardware/param")}
    assert [params["joint_commands_topic"]] == ready["obeys"]
    assert params["joint_states_topic"] in ready["publishes"]
    assert float(params["trigger_joint_command_threshold"]) < 0
    assert [joint.get("name") for joint in control.findall("joint")] == ready["joints"]
    file = (EXAMPLE / "node.toml").read_text()
    for joint in control.findall("joint"):
        (command,) = [it.get("name") for it in joint.findall("command_interface")]
        assert f'command = "{command}"' in file.split(f'name = "{joint.get("name")}"')[1].split("[[")[0]
        assert {it.get("name") for it in joint.findall("state_interface")} == {"position", "velocity"}
    controllers = YAML(typ="safe").load(EXAMPLE / "controllers.yaml")
    parameters = controllers["arm_controller"]["ros__parameters"]
    assert parameters["joints"] == ready["joints"]
    rate = controllers["controller_manager"]["ros__parameters"]["update_rate"]
    assert rate >= 5 / float(file.split("time_to_live_seconds = ")[1].split()[0])


def test_a_file_that_is_not_possible_is_refused(run, file):
    words = ["node", "-p", "sim:", "--listen", "tcp/127.0.0.1:0", "--ros2", "--config", file]
    for before, after, why in [
        ('line = "st0"', 'line = "st7"', "no line st7; the lines are st0, rmd0"),
        ('command = "position"', 'command = "velocity"\nspeed = 1', "speed"),
    ]:
        file.write_text(FILE.replace(before, after))
        refused = run(*words)
        assert refused.code == 2 and why in refused.err, refused
