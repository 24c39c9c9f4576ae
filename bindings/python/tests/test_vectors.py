"""The wire vectors of both protocols, through the package: requests both ways, replies into values."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import motorlink
from motorlink import rmd, st

VECTORS = Path(__file__).parents[3] / "vectors"

Vector = dict[str, Any]


def vectors(name: str) -> list[Vector]:
    """Every vector of a file."""
    found: list[Vector] = json.loads((VECTORS / f"{name}.json").read_text())
    assert len(found) > 50
    return found


ST = vectors("st")
RMD = vectors("rmd")


def named(vector: Vector) -> str:
    """The vector in a test's name."""
    return str(vector["name"])


def profiles(vector: Vector) -> list[str]:
    """The profiles that a vector is for."""
    both = ["spec", "mcsdk-5.4"]
    return both if vector["profile"] == "both" else [vector["profile"]]


def st_request(vector: Vector) -> st.Request:
    """The request that a vector's fields describe, as a program would ask for it."""
    fields = vector["fields"]
    make: dict[str, Callable[[], st.Request]] = {
        "SET_REG": lambda: st.Request.write_bytes(
            fields["register"], bytes.fromhex(fields["value"])
        ),
        "GET_REG": lambda: st.Request.read(
            fields["register"], profile=profiles(vector)[0], raw=True
        ),
        "EXECUTE_CMD": lambda: st.Request.execute(fields["command"]),
        "GET_BOARD_INFO": st.Request.info,
        "GET_FW_VERSION": st.Request.firmware_version,
        "SET_RAMP": lambda: st.Request.ramp(fields["speed"], fields["duration"] / 1000),
        "GET_REVUP_DATA": lambda: st.Request.revup(fields["phase"]),
        "SET_REVUP_DATA": lambda: st.Request.set_revup(
            fields["phase"], fields["speed"], fields["torque"], fields["duration"] / 1000
        ),
        "SET_CURRENT_REF": lambda: st.Request.current(fields["iq"], fields["id"]),
        "GET_MP_INFO": lambda: st.Request.profiler_info(bytes.fromhex(fields["steps"])),
        "GET_DATA_ELEMENT": lambda: st.Request.read_segment(fields["segment"], ["STATUS"]),
        "CONFIG_DYN_STRUCT": lambda: st.Request.configure_segment(
            fields["segment"], list(bytes.fromhex(fields["registers"]))
        ),
        "SET_TORQUE_RAMP": lambda: st.Request.torque_ramp(
            fields["torque"], fields["duration"] / 1000
        ),
        "SET_POSITION_CMD": lambda: st.Request.move_to(fields["angle"], fields["duration"]),
    }
    return make[vector["code"]]()


#: Names of the vectors' fields with their units, as the package has them.
ST_FIELDS = {
    "speed": "speed_rpm",
    "duration": "duration_ms",
    "torque": "torque_s16a",
    "iq": "iq_s16a",
    "id": "id_s16a",
    "angle": "angle_rad",
}


def st_fields(vector: Vector) -> dict[str, object]:
    """The fields as `Request.fields` has them."""
    fields: dict[str, object] = {}
    for name, value in vector["fields"].items():
        if name == "command_name":
            continue
        seconds = vector["code"] == "SET_POSITION_CMD" and name == "duration"
        named = "duration_s" if seconds else ST_FIELDS.get(name, name)
        fields[named] = bytes.fromhex(value) if isinstance(value, str) else value
    return fields


@pytest.mark.parametrize("vector", ST, ids=named)
def test_an_st_request_encodes_to_its_bytes_and_decodes_from_them(vector: Vector) -> None:
    frame = bytes.fromhex(vector["request"])
    request = st_request(vector)
    assert request.code == vector["code"]
    assert request.encode(vector["motor"]) == frame
    for profile in profiles(vector):
        motor, decoded = st.Request.decode(frame, profile=profile)
        assert (motor, decoded.code) == (vector["motor"], vector["code"])
        assert decoded.fields == st_fields(vector)
        assert decoded.encode(motor) == frame
    name = vector["fields"].get("command_name")
    if name:
        assert st.Request.execute(name) == request


@pytest.mark.parametrize("vector", [v for v in ST if "reply" in v], ids=named)
def test_an_st_reply_decodes_to_its_fields(vector: Vector) -> None:
    reply, answer = bytes.fromhex(vector["reply"]), vector["answer"]
    request = st_request(vector)
    if "error" in answer:
        with pytest.raises(motorlink.Refused) as refused:
            request.decode_reply(reply)
        assert refused.value.code == answer["error"]
        assert refused.value.name == answer.get("error_name")
        return
    if vector["code"] == "GET_DATA_ELEMENT":
        _, decoded = st.Request.decode(bytes.fromhex(vector["request"]))
        assert decoded.decode_reply(reply) == bytes.fromhex(answer["values"])
        chosen = st.Request.read_segment(1, ["STATUS", "SPEED_MEAS", "I_Q"])
        assert chosen.decode_reply(reply) == {"STATUS": 6, "SPEED_MEAS": 1500, "I_Q": -77}
        return
    value = request.decode_reply(reply)
    if vector["code"] == "GET_REG":
        assert value % 2**32 == answer["bits"] % 2**32
        register = vector["fields"]["register"]
        for profile in profiles(vector):
            assert motorlink._core.st_register(register, profile).type == answer["type"]
    elif vector["code"] == "GET_BOARD_INFO":
        assert value == (tuple(answer["version"]), answer["name"])
    elif vector["code"] == "GET_FW_VERSION":
        assert value == (answer["name"], answer["version"])
    elif vector["code"] == "GET_REVUP_DATA":
        assert value == (answer["speed"], answer["torque"], answer["duration"] / 1000)
    else:
        assert (value, answer) == (None, {})


def rmd_request(frame: rmd.Frame, code: int) -> rmd.Request:
    """The request that does what a frame says, as a program would ask for it."""
    values = frame.values
    gains = tuple(int(value) for value in values.values())
    turn = {"clockwise": values.get("direction") == 0}
    degrees, dps = values.get("angle_deg", 0.0), values.get("max_speed_dps")
    make: dict[int, Callable[[], rmd.Request]] = {
        0x30: rmd.Request.read_gains,
        0x31: lambda: rmd.Request.write_gains(*gains),
        0x32: lambda: rmd.Request.write_gains(*gains, rom=True),
        0x33: rmd.Request.read_acceleration,
        0x34: lambda: rmd.Request.write_acceleration(values["acceleration_dps2"]),
        0x90: rmd.Request.read_encoder,
        0x91: lambda: rmd.Request.write_encoder_offset_to_rom(values["offset"]),
        0x19: rmd.Request.write_zero_to_rom,
        0x92: rmd.Request.read_angle,
        0x94: rmd.Request.read_circle_angle,
        0x9A: rmd.Request.read_status,
        0x9B: rmd.Request.clear_errors,
        0x9C: rmd.Request.read_motion,
        0x9D: rmd.Request.read_phase_currents,
        0x80: rmd.Request.off,
        0x81: rmd.Request.stop,
        0x88: rmd.Request.run,
        0xA1: lambda: rmd.Request.torque(values["iq_a"]),
        0xA2: lambda: rmd.Request.speed(values["speed_dps"]),
        0xA3: lambda: rmd.Request.move_to(degrees),
        0xA4: lambda: rmd.Request.move_to(degrees, dps),
        0xA5: lambda: rmd.Request.turn_to(degrees, **turn),
        0xA6: lambda: rmd.Request.turn_to(degrees, dps, **turn),
    }
    return make[code]()


@pytest.mark.parametrize("vector", [v for v in RMD if v["dir"] == "request"], ids=named)
def test_an_rmd_request_encodes_to_its_bytes_and_decodes_from_them(vector: Vector) -> None:
    can_id, data = int(vector["id"], 16), bytes.fromhex(vector["bytes"])
    frame = rmd.decode(can_id, data, reply=False)
    assert frame.digits == vector["fields"]
    if vector["command"] == "torque4":
        assert frame.motor is None
        return
    code = int(vector["command"], 16)
    assert frame.motor == can_id - 0x140
    decoded = rmd.Request.decode(data)
    assert (decoded.code, decoded.encode()) == (code, data)
    # What the document does not allow is read, and never made; nor is a max speed of 0.
    if (
        abs(frame.digits.get("iq", 0)) > 2000
        or (code in (0xA5, 0xA6) and frame.digits["angle"] >= 36000)
        or frame.digits.get("max_speed") == 0
    ):
        with pytest.raises(motorlink.BadValue):
            rmd_request(frame, code)
    elif frame.digits.get("direction", 0) <= 1:
        assert rmd_request(frame, code) == decoded


#: Digits of a physical value, for the fields of a reply.
def close(value: float, digits: int, scale: float) -> bool:
    return abs(value - digits * scale) < 1e-9 * max(1.0, abs(value))


@pytest.mark.parametrize("vector", [v for v in RMD if v["dir"] == "reply"], ids=named)
def test_an_rmd_reply_decodes_to_its_fields(vector: Vector) -> None:
    can_id, data, fields = int(vector["id"], 16), bytes.fromhex(vector["bytes"]), vector["fields"]
    assert rmd.decode(can_id, data, reply=True).digits == fields
    torque4 = vector["command"] == "torque4"
    code = 0xA1 if torque4 else int(vector["command"], 16)
    answer = rmd.Request.decode(bytes([code]) + bytes(7)).decode_reply(data)
    if isinstance(answer, rmd.MotionStatus):
        assert answer.temperature_c == fields["temperature"]
        assert close(answer.iq_a, fields["iq"], 33 / 2048)
        assert (answer.speed_dps, answer.encoder) == (fields["speed"], fields["encoder"])
    elif isinstance(answer, rmd.MotorStatus):
        assert answer.temperature_c == fields["temperature"]
        assert close(answer.voltage_v, fields["voltage"], 0.1)
        assert answer.errors.bits == fields["errors"]
        # The other bits mean nothing.
        assert len(answer.errors.names) == bin(fields["errors"] & 0x09).count("1")
        assert bool(answer.errors) == bool(fields["errors"] & 0x09)
    elif isinstance(answer, rmd.PhaseCurrents):
        phases = (fields["phase_a"], fields["phase_b"], fields["phase_c"])
        assert all(close(value, digits, 1 / 64) for value, digits in zip(answer, phases))
    elif isinstance(answer, (rmd.Gains, rmd.Encoder)):
        assert answer._asdict() == fields
    elif code in (0x92, 0x94):
        assert close(answer, fields["angle"], 0.01)
    elif fields:
        assert [answer] == list(fields.values())
    else:
        assert answer is None


def test_every_kind_of_vector_was_there() -> None:
    assert len({vector["code"] for vector in ST}) == 14
    for direction in ("request", "reply"):
        assert len({v["command"] for v in RMD if v["dir"] == direction}) == 24
