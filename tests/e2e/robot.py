"""A ROS 2 machine without ROS: zenoh-ros2-sdk, with messages as ROS 2 Jazzy defines them."""

import json
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

#: What the SDK would load from the repositories of ROS.
MESSAGES = {
    "builtin_interfaces/msg/Time.msg": "int32 sec\nuint32 nanosec\n",
    "std_msgs/msg/Header.msg": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "sensor_msgs/msg/JointState.msg": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "diagnostic_msgs/msg/KeyValue.msg": "string key\nstring value\n",
    "diagnostic_msgs/msg/DiagnosticStatus.msg": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n"
    ),
    "diagnostic_msgs/msg/DiagnosticArray.msg": "std_msgs/Header header\nDiagnosticStatus[] status\n",
    "service_msgs/msg/ServiceEventInfo.msg": (
        "uint8 event_type\nbuiltin_interfaces/Time stamp\nchar[16] client_gid\nint64 sequence_number\n"
    ),
    # ROS adds the member to an empty request; the SDK does not.
    "std_srvs/srv/Trigger.srv": (
        "uint8 structure_needs_at_least_one_member\n---\nbool success\nstring message\n"
    ),
}
STATE = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
TRIGGER = "std_srvs/srv/Trigger"


class Robot:
    """A session of the SDK. A process can have one."""

    def __init__(self, address):
        import zenoh_ros2_sdk
        from zenoh_ros2_sdk import message_registry, session

        self.sdk = zenoh_ros2_sdk
        host, port = address.removeprefix("tcp/").rsplit(":", 1)
        self.at = {"router_ip": host, "router_port": int(port), "domain_id": 0}
        self.folder = tempfile.TemporaryDirectory()
        for name, text in MESSAGES.items():
            path = Path(self.folder.name, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        session.ZenohSession._instance = None
        self.session = session.ZenohSession.get_instance(host, int(port))
        registry = message_registry.get_registry()
        registry.messages_dir = Path(self.folder.name)
        registry._loaded_types.clear()

    def hears(self, topic, kind):
        """The messages of a topic: a list that grows."""
        heard = []
        self.sdk.ROS2Subscriber(topic, kind, heard.append, **self.at)
        return heard

    def commands(self):
        """A function that publishes joint commands."""
        import numpy

        publish = self.sdk.ROS2Publisher("/arm1/joint_commands", STATE, **self.at).publish
        types = self.session.store.types
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")

        def command(name, position=(), velocity=(), effort=()):
            arrays = {"position": position, "velocity": velocity, "effort": effort}
            arrays = {key: numpy.array(values, dtype=float) for key, values in arrays.items()}
            publish(header=header, name=list(name), **arrays)

        return command

    def call(self, service):
        """The response of a service."""
        client = self.sdk.ROS2ServiceClient(service, TRIGGER, timeout=30.0, **self.at)
        try:
            return client.call(structure_needs_at_least_one_member=0)
        finally:
            client.close()

    def close(self):
        self.session.session.close()
        self.folder.cleanup()


def commanding(address, period, message):
    """A program that publishes a command again and again: until it is killed, or silent after SIGUSR1."""
    command, silence = Robot(address).commands(), threading.Event()
    signal.signal(signal.SIGUSR1, lambda *_: silence.set())
    print("ready", flush=True)
    while not silence.is_set():
        command(**message)
        time.sleep(period)
    time.sleep(600)


if __name__ == "__main__":
    commanding(sys.argv[1], float(sys.argv[2]), json.loads(sys.argv[3]))
