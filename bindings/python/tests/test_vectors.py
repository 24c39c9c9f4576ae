"""A wire vector of each kind of both protocols: requests are encoded and decoded, replies become values."""

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


def one_of_each(vectors: list[Vector], *kind: str) -> list[Vector]:
    """The vector of each kind with the most values that are not 0. The others differ in values only,
    which `crates/proto/tests` decode.
    """
    found: dict[tuple[str, ...], Vector] = {}
    for vector in sorted(vectors, key=lambda one: -sum(map(bool, one["fields"].values()))):
        found.setdefault((*(vector[name] for name in kind), *vector.get("answer", {})), vector)
    return list(found.values())


ST = one_of_each(vectors("st"), "code")
RMD = one_of_each(vectors("rmd"), "dir", "command")


def named(vector: Vector) -> str:
    """The vector in a test's name."""
    return str(vector["name"])


def profiles(vector: Vector) -> list[str]:
    """The profiles that a vector is for."""
    both = ["spec", "mcsdk-5.4"]
    return both if vector["profile"] == "both" else [vector["profile"]]


def st_request(vector: Vector) -> st.Request:
    """The request of a vector's fields, made as in a program."""
    fields = vector["fields"]
    make: dict[str, Callable[[], st.Request]] = {
        "SET_REG": lambda: st.Request.set_register_bytes(
            fields["register"], bytes.fromhex(fields["value"])
        ),
        "GET_REG": lambda: st.Request.get_register(
            fields["register"], profile=profiles(vector)[0], raw=True
        ),
        "EXECUTE_CMD": lambda: st.Request.execute_command(fields["command"]),
        "GET_BOARD_INFO": st.Request.get_board_info,
        "GET_FW_VERSION": st.Request.get_firmware_version,
        "SET_RAMP": lambda: st.Request.set_ramp(fields["speed"], fields["duration"] / 1000),
        "GET_REVUP_DATA": lambda: st.Request.get_revup_data(fields["phase"]),
        "SET_REVUP_DATA": lambda: st.Request.set_revup_data(
            fields["phase"], fields["speed"], fields["torque"], fields["duration"] / 1000
        ),
        "SET_CURRENT_REF": lambda: st.Request.set_current_reference(fields["iq"], fields["id"]),
        "GET_MP_INFO": lambda: st.Request.get_profiler_info(bytes.fromhex(fields["steps"])),
        "GET_DATA_ELEMENT": lambda: st.Request.get_segment(fields["segment"], ["STATUS"]),
        "CONFIG_DYN_STRUCT": lambda: st.Request.configure_segment(
            fields["segment"], list(bytes.fromhex(fields["registers"]))
        ),
        "SET_TORQUE_RAMP": lambda: st.Request.set_torque_ramp(
            fields["torque"], fields["duration"] / 1000
        ),
        "SET_POSITION_CMD": lambda: st.Request.set_position(fields["angle"], fields["duration"]),
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
    """The fields under the names of `Request.fields`."""
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
        assert st.Request.execute_command(name) == request


@pytest.mark.parametrize("vector", [v for v in ST if "reply" in v], ids=named)
def test_an_st_reply_decodes_to_its_fields(vector: Vector) -> None:
    reply, answer = bytes.fromhex(vector["reply"]), vector["answer"]
    request = st_request(vector)
    if "error" in answer:
        with pytest.raises(motorlink.RefusedError) as refused:
            request.decode_reply(reply)
        assert refused.value.code == answer["error"]
        assert refused.value.name == answer.get("error_name")
        return
    if vector["code"] == "GET_DATA_ELEMENT":
        _, decoded = st.Request.decode(bytes.fromhex(vector["request"]))
        assert decoded.decode_reply(reply) == bytes.fromhex(answer["values"])
        chosen = st.Request.get_segment(1, ["STATUS", "SPEED_MEAS", "I_Q"])
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


def rmd_request(frame: rmd.Frame, stem: str) -> rmd.Request:
    """The request of a frame, made as in a program."""
    values: dict[str, float | str] = dict(frame.values)
    if "direction" in values:
        values["direction"] = "counterclockwise" if values["direction"] else "clockwise"
    request: rmd.Request = getattr(rmd, stem)(**values)
    assert request == getattr(rmd.Request, stem)(**values)
    return request


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
    assert decoded.stem is not None
    assert rmd_request(frame, decoded.stem) == decoded


#: The commands of a motor. 0x280 is a command for four motors.
COMMANDS = [name for name in vars(rmd.Request) if not name.startswith("_")]
#: Commands whose reply repeats the request.
ECHOED = {"write_pid_ram", "write_pid_rom", "write_acceleration_ram", "off", "stop", "run"}
#: A digit of the values that are not in whole units.
SCALES = {"iq_amps": 33 / 2048, "voltage_volts": 0.1, "angle_degrees": 0.01}


@pytest.mark.parametrize("vector", [v for v in RMD if v["dir"] == "reply"], ids=named)
def test_an_rmd_reply_decodes_to_its_fields(vector: Vector) -> None:
    can_id, data, fields = int(vector["id"], 16), bytes.fromhex(vector["bytes"]), vector["fields"]
    frame = rmd.decode(can_id, data, reply=True)
    assert frame.digits == fields
    code = 0xA1 if vector["command"] == "torque4" else int(vector["command"], 16)
    request = rmd.Request.decode(bytes([code]) + bytes(7))
    answer = request.decode_reply(data)
    if request.stem in ECHOED:
        assert answer is None
        return
    values: dict[str, Any] = dict.fromkeys(frame.values, answer)
    if isinstance(answer, tuple):
        values = getattr(answer, "_asdict")()
    if "errors" in values:
        errors = values.pop("errors")
        assert errors.bits == fields["errors"]
        # The other bits have no meaning.
        assert len(errors.names) == bin(fields["errors"] & 0x09).count("1")
        assert bool(errors) == bool(fields["errors"] & 0x09)
    assert list(frame.values)[: len(values)] == list(values)
    for (name, value), digits in zip(values.items(), fields.values()):
        scale = 1 / 64 if name.startswith("phase_") else SCALES.get(name, 1)
        assert abs(value - digits * scale) < 1e-9 * max(1.0, abs(value))
        assert value == frame.values[name]


def test_every_kind_of_vector_was_tested() -> None:
    assert len({vector["code"] for vector in ST}) == 14
    assert any("error" in vector.get("answer", {}) for vector in ST)
    for direction in ("request", "reply"):
        assert len({v["command"] for v in RMD if v["dir"] == direction}) == len(COMMANDS) + 1
