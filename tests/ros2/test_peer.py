"""`motorlink node --ros2`, as hiroz sees it: an implementation of rmw_zenoh's format in Rust. `make ros2` runs it."""

import json
import math
import os
import struct
import subprocess

import pytest

from program import eventually
from sharing import Client, event
from test_ros2 import FILE, RPM, angle, stands

PEER = os.environ.get("ROS2_PEER")


@pytest.fixture
def node(nodes, tmp_path):
    file = tmp_path / "node.toml"
    file.write_text(FILE)
    return nodes("arm1", "--ros2", "--config", file)


@pytest.fixture
def direct(node):
    return Client(node.path, "looks")


@pytest.fixture
def peer(node):
    def peer(*words):
        done = subprocess.run([PEER, node.address, *map(str, words)], capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    return peer


def test_the_graph_has_the_topics_and_services(node, peer):
    graph = peer("graph")
    kinds = {name: kind for name, kind in graph["topics"] if "arm1" in name or name == "/diagnostics"}
    state = "sensor_msgs::msg::dds_::JointState_"
    assert kinds == {
        "/arm1/joint_states": state,
        "/arm1/joint_commands": state,
        "/diagnostics": "diagnostic_msgs::msg::dds_::DiagnosticArray_",
    }
    services = {name: kind for name, kind in graph["services"] if name.startswith("/arm1/")}
    assert services == {f"/arm1/{name}": "std_srvs::srv::dds_::Trigger_" for name in ("stop_all", "clear_faults")}
    assert ["arm1"] == [name for name, *_ in graph["nodes"] if "arm1" in name]


def test_joint_states_and_diagnostics_are_read(node, peer, direct):
    assert direct.command("rmd0", 2, *struct.pack("<BxHi", 0xA4, 360, 9000))["kind"] == "answer"
    eventually(lambda: abs(angle(direct) - 90) < 0.2, "the arm at 90°", within=20)
    eventually(lambda: abs(direct.dps(2)) < 2, "the arm at rest", within=20)
    state = peer("states", "/arm1/joint_states")
    assert state["name"] == ["wheel", "arm", "watched"]
    # JSON has no NaN.
    assert state["position"][0] is None
    assert state["position"][1] == pytest.approx(0.5 - math.radians(angle(direct)) / 6, abs=0.001)
    status = {it["name"]: it for it in peer("diagnostics")}
    assert status["arm1: arm"]["hardware_id"] == "arm1/rmd0/2"
    assert status["arm1: wheel"]["values"]["motor"] == "st0, motor 1"


def test_commands_turn_a_wheel_until_they_end(node, peer, direct):
    speeds = []
    with subprocess.Popen([PEER, node.address, "velocity", "/arm1/joint_commands", "wheel", str(900 * RPM), "4"]) as run:
        while run.poll() is None:
            speeds.append(direct.rpm())
    assert run.returncode == 0
    assert max(speeds) > 800
    direct.until(event("stopping", motor=1, by="ros2"))
    stands(direct)


def test_services_answer(node, peer):
    for service in ("stop_all", "clear_faults"):
        assert peer("call", f"/arm1/{service}") == {"success": True, "message": "all motors confirmed"}
