"""A program at a node, as docs/FLEET-PROTOCOL.md describes it, written for the tests alone."""

import json
import os
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import zenoh

from sharing import samples


def network(address):
    """A Zenoh session that knows nothing but this address, or a configuration in a file."""
    if str(address).endswith(".json5"):
        return zenoh.open(zenoh.Config.from_file(str(address)))
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([address]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def runs(zenoh, node, within=10):
    """The runs of the nodes with this name. It is waited for one."""
    end = time.monotonic() + within
    while True:
        tokens = zenoh.liveliness().get(f"motorlink/v1/{node}/node/alive/*")
        found = [str(it.ok.key_expr).rsplit("/", 1)[1] for it in tokens if it.ok is not None]
        if found or time.monotonic() > end:
            return found
        time.sleep(0.05)


class Over(Exception):
    """The node has ended the session."""


class Member:
    """A session at a node."""

    def __init__(self, address, node, who="member", deadline=0.5, motion=None, joins=True):
        self.zenoh = network(address)
        (self.boot,) = runs(self.zenoh, node)
        self.node = node
        self.base = f"motorlink/v1/{node}/node/ask/{self.boot}"
        self.who, self.session = who, os.urandom(8).hex()
        self.last = self.urgent = self.pulls = self.ids = self.after = 0
        self.deadline, self.alive = deadline, None
        self.heard = []
        if joins:
            ask = {"ask": "join", "protocol": 1, "program": "test", "deadline": deadline}
            joined = self.ask("see", ask if motion is None else {**ask, "motion": motion})
            assert joined["kind"] == "joined", joined
            self.ahead = joined["t"] - time.monotonic()

    def ask(self, scope, ask, within=2.0, session=None):
        """The first answer to a request; None: there is none."""
        key = f"{self.base}/{scope}/{self.who}/{session or self.session}"
        payload = ask if isinstance(ask, bytes) else json.dumps(ask).encode()
        mode = zenoh.ConsolidationMode.NONE
        for reply in self.zenoh.get(key, payload=payload, timeout=within, consolidation=mode):
            if reply.ok is not None:
                head = reply.ok.attachment
                if head is None:
                    return json.loads(reply.ok.payload.to_bytes())
                self.take(reply.ok.payload.to_bytes())
                return json.loads(head.to_bytes())
        return None

    def now(self):
        """The clock of the node."""
        return time.monotonic() + self.ahead

    def post(self, scope="act", sent=None, number=None, **request):
        """Sends a request of a share; gives the node's answer, and the id."""
        self.ids += 1
        if number is None:
            self.last += 1
            number = self.last
        body = {"number": number}
        body["time_to_live"] = request.get("time_to_live", 1.0)
        body["sent"] = self.now() if sent is None else sent
        body["request"] = {"id": self.ids, **request}
        return self.ask(scope, {"ask": "post", **body}), self.ids

    def command(self, *code, line="st0", motor=1, within=30, **more):
        """Posts a command; gives the answer of the share.

        A line whose drive answers its first question late is quiet for twice the timeout (SPEC-NOTES S16).
        """
        wanted = {"ask": "command", "line": line, "motor": motor, "time_to_live": within}
        taken, sent = self.post(**more, **wanted, bytes=list(code))
        assert taken["kind"] == "taken", taken
        return self.answer(sent)

    def stop(self, motor=None, within=2.0):
        """Sends a stop; gives the answer of the share."""
        self.urgent += 1
        self.ids += 1
        request = {"id": self.ids, "ask": "stop"}
        if motor:
            request["motor"] = motor
        post = {"number": self.urgent, "sent": 0.0, "time_to_live": 1.0}
        ask = {"ask": "urgent", "after": self.last, **post, "request": request}
        assert self.ask("stop", ask, within)["kind"] == "taken"
        return self.answer(self.ids)

    def pull(self, wait=0.5):
        """Takes what the share says."""
        self.pulls += 1
        ask = {"ask": "pull", "number": self.pulls, "after": self.after}
        answer = self.ask("see", {**ask, "wait": wait}, within=wait + 2)
        if answer and answer["kind"] == "pulled":
            self.after += answer["count"]
        return answer

    def take(self, stream):
        while stream:
            size, kind = struct.unpack_from("<IB3x", stream)
            payload, stream = stream[8 : 8 + size], stream[8 + size :]
            self.heard.append(json.loads(payload) if kind == 1 else samples(payload))

    def answer(self, sent):
        """The share's answer to a request."""
        end = time.monotonic() + 40
        while time.monotonic() < end:
            for said in self.heard:
                if isinstance(said, dict) and said.get("id") == sent:
                    self.heard.remove(said)
                    return said
            said = self.pull()
            if said and said["kind"] == "over":
                raise Over(said["why"])
        raise AssertionError(f"no answer to {sent}")

    def lives(self):
        """Gives signs of life from now on, in a thread."""

        def give():
            while self.alive:
                self.ask("act", {"ask": "alive", "sent": self.now()}, within=0.5)
                time.sleep(self.deadline / 5)

        self.alive = threading.Thread(target=give, daemon=True)
        self.alive.start()

    def dies(self):
        """Gives none any more."""
        self.alive = None

    def turn(self, rpm=1500):
        """Turns ST motor 1."""
        ramp = self.command(7, *struct.pack("<iH", rpm, 100))
        start = self.command(3, 1)
        assert {ramp["kind"], start["kind"]} == {"answer"}, (ramp, start)


class Killed:
    """A Python program that is killed at the end. Its first line is `said`."""

    def __init__(self, *words):
        words = [sys.executable, *words]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent)
        self.said = self.process.stdout.readline()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


#: A cable between two addresses. SIGSTOP cuts it; what waits passes after SIGCONT.
CABLE = """
import socket, sys, threading
near = socket.create_server(("127.0.0.1", 0))
print(near.getsockname()[1], flush=True)

def passes(source, target):
    while data := source.recv(65536):
        target.sendall(data)

while True:
    one, _ = near.accept()
    host, port = sys.argv[1].rsplit(":", 1)
    other = socket.create_connection((host, int(port)))
    for ends in ((one, other), (other, one)):
        threading.Thread(target=passes, args=ends, daemon=True).start()
"""


class Cable(Killed):
    """The way to a node, which can be cut."""

    def __init__(self, node):
        super().__init__("-c", CABLE, node.address.removeprefix("tcp/"))
        self.address = f"tcp/127.0.0.1:{int(self.said)}"
