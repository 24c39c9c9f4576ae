"""Recordings that tests make with the Python package `mcap`, message by message."""

import struct

from mcap.writer import CompressionType, Writer

START = 1_790_000_000_000_000_000
TOML = "[settings]\nSPEED_KP = 800\n"
TIME = f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
LOG = (
    "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
    "string function\nuint32 line\n"
)


def cdr(*fields):
    """Fields as little-endian CDR: floats, whole numbers as (bytes, number), texts."""
    out = bytearray()
    for field in fields:
        if isinstance(field, str):
            text = field.encode() + b"\0"
            out += b"\0" * (-len(out) % 4) + struct.pack("<I", len(text)) + text
            continue
        size, packed = (8, struct.pack("<d", field)) if isinstance(field, float) else (
            field[0], field[1].to_bytes(field[0], "little"))
        out += b"\0" * (-len(out) % size) + packed
    return b"\0\1\0\0" + bytes(out)


def stamp(time):
    """A time in ns since 1970, as fields."""
    return (4, time // 10**9), (4, time % 10**9)


class Recording:
    """A recording that is written into a file."""

    def __init__(self, path, compression=CompressionType.ZSTD, chunk=4096):
        self.file = open(path, "wb")
        self.writer = Writer(
            self.file, compression=compression, chunk_size=chunk, enable_data_crcs=True
        )
        self.writer.start(profile="ros2", library="test")
        self.channels = {}

    def drive(self, label="st0", motor=1, **facts):
        facts = {"label": label, "motor": str(motor), "port": f"serial:./{label}", "protocol": "st", **facts}
        self.writer.add_metadata("drive", facts)
        text = TOML.encode()
        self.writer.add_attachment(START, START, f"{label}_motor{motor}.toml", "application/toml", text)

    def topic(self, name, kind, definition, facts=None):
        schema = self.writer.register_schema(kind, "ros2msg", (definition + TIME).encode())
        self.channels[name] = self.writer.register_channel(name, "cdr", schema, facts or {})

    def signals(self, topic, **units):
        """Declares signals with their units, in capitals as keywords."""
        kind = "motorlink/msg/" + "".join(word.capitalize() for word in topic.replace("_", "/").split("/"))
        lines = [
            f"float64 {name.lower()} # {name}{f' [{unit}]' if unit else ''}\n" for name, unit in units.items()
        ]
        head = "builtin_interfaces/Time stamp\nfloat64 span_s # [s]\n"
        self.topic(topic, kind, head + "".join(lines))

    def add(self, topic, time, *fields):
        """Adds a message; `time` is in s from the start."""
        at = START + round(time * 1e9)
        self.writer.add_message(self.channels[topic], at, cdr(*stamp(at), *fields), at)

    def row(self, topic, time, *values):
        self.add(topic, time, 0.001, *map(float, values))

    def event(self, time, kind, name, message, by="test"):
        if "/events" not in self.channels:
            self.topic("/events", "rcl_interfaces/msg/Log", LOG)
        self.add("/events", time, (1, 20), name, message, by, kind, (4, 0))

    def finish(self):
        self.writer.finish()
        self.file.close()


def short(path, **options):
    """Two motors for two seconds, with an outage of the first one and events."""
    out = Recording(path, **options)
    out.writer.add_metadata("motorlink", {"version": "0.1.0", "format": "1", "command": "motorlink record"})
    out.drive("st0", 1, identity="board")
    out.drive("can0", 2, protocol="rmd")
    out.signals("/st0/motor1/signals", SPEED_MEAS="rpm", STATUS="")
    out.signals("/st0/motor1/signals_2_hz", BUS_VOLTAGE="V")
    out.signals("/can0/motor2/signals", speed="°/s")
    out.event(0, "commanded", "st0/motor1", "motor 1 of st0: start")
    for n in range(200):
        time = n / 100
        if not 0.8 < time < 1.2:
            out.row("/st0/motor1/signals", time, 1500 + n, 6 if n > 20 else 0)
        out.row("/can0/motor2/signals", time + 0.001, 360 if n != 77 else 9000)
        if n % 50 == 0:
            out.row("/st0/motor1/signals_2_hz", time + 0.0005, 24 + n / 100)
        if n == 80:
            out.event(time, "lost", "st0", "st0 does not answer")
        if n == 120:
            out.event(time, "back", "st0", "st0 answers again")
    out.finish()
