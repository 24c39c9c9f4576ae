"""A viewer that speaks Foxglove's WebSocket protocol, written for the tests alone, from its published
description. mcap-ros2-support decodes its messages."""

import json
import struct
import time
from collections import namedtuple

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from websockets.sync.client import connect

CURRENT, OLDER = "foxglove.sdk.v1", "foxglove.websocket.v1"

Message = namedtuple("Message", "topic time data")


def opened(url, protocols=(CURRENT,), **options):
    """A WebSocket, as viewers open it."""
    # Without a limit it reads on while nobody asks, and answers when the connection is closed.
    options = {"max_size": None, "max_queue": None, "compression": None, "close_timeout": 1, **options}
    return connect(url, subprotocols=protocols or None, **options)


class Viewer:
    """A viewer that has read what the server is."""

    def __init__(self, url, **options):
        self.socket = opened(url, **options)
        #: By topic.
        self.channels, self.statuses, self.messages = {}, [], []
        #: The topic of each subscription.
        self.topics, self.decoders = {}, DecoderFactory()
        self.info = json.loads(self.socket.recv(timeout=20))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, op, **members):
        self.socket.send(json.dumps({"op": op, **members}))

    def receive(self, within=20):
        """Takes the next message."""
        message = self.socket.recv(timeout=within)
        if isinstance(message, bytes):
            code, subscription, at = struct.unpack_from("<BIQ", message)
            assert code == 1
            self.messages.append(Message(self.topics[subscription], at, message[13:]))
            return
        text = json.loads(message)
        if text["op"] == "advertise":
            self.channels.update((it["topic"], it) for it in text["channels"])
        else:
            assert text["op"] == "status", text
            self.statuses.append((text["level"], text["message"]))

    def until(self, condition, within=20):
        """Reads until `condition` is true, and gives what it gave."""
        end = time.monotonic() + within
        while not (found := condition()):
            self.receive(max(0.0, end - time.monotonic()))
        return found

    def subscribe(self, topic):
        """Subscribes to a topic once it is there; gives the number of the subscription."""
        channel = self.until(lambda: self.channels.get(topic))
        number = 1000 + len(self.topics)
        self.topics[number] = topic
        self.send("subscribe", subscriptions=[{"id": number, "channelId": channel["id"]}])
        return number

    def of(self, topic):
        """The decoded messages of a topic: pairs of time and message."""
        channel = self.channels[topic]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        schema = Schema(channel["id"] + 1, channel["schema"].encode(), "ros2msg", channel["schemaName"])
        decode = self.decoders.decoder_for("cdr", schema)
        return [(it.time, decode(it.data)) for it in self.messages if it.topic == topic]

    def reads(self, topic, count):
        """Subscribes, and gives this many messages."""
        self.subscribe(topic)
        self.until(lambda: sum(it.topic == topic for it in self.messages) >= count)
        return self.of(topic)

    def is_told(self, part):
        """Waits for a status with this part; gives its level."""
        return self.until(lambda: next((level for level, text in self.statuses if part in text), None))
