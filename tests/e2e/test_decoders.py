"""`motorlink decode` and the dissector for Wireshark, on one and the same capture, field by field."""

import json
import math
import shutil

import pytest
from wireshark import on_can, on_line, some

pytestmark = pytest.mark.skipif(not shutil.which("tshark"), reason="tshark is not installed")

REPLIES = 0xE0, 0xF0, 0xFF
TYPES = {None: "0", "request": "1", "reply": "2"}
# The end of a field's name for each unit.
UNITS = {
    "": "", "°": "_degrees", "°/s": "_dps", "°/s²": "_dps2", "°C": "_celsius", "A": "_amps", "V": "_volts",
    "rpm": "_rpm", "ms": "_ms", "s": "_s", "s16A": "_s16a", "rad": "_rad",
}
# Fields of a packet that are no values of its frame.
APART = {
    "motor", "type", "type.source", "code", "response_in", "response_to", "response_time", "header", "length",
    "payload", "message", "checksum", "checksum.status", "value", "digits", "surplus",
}


@pytest.fixture(scope="module")
def both(run, packets, tshark, tmp_path_factory):
    """The entries of `motorlink decode` with their text, and the fields of tshark with the Info column."""

    def both(protocol, capture, *arguments, preferences=()):
        path = capture.write(tmp_path_factory.mktemp("both") / "capture.pcapng")
        entries = run("decode", protocol, "--json", *arguments, path).lines
        texts = run("decode", protocol, *arguments, path).out.splitlines()
        found = packets(capture, preferences=preferences)
        infos = tshark(capture, "-T", "fields", "-e", "_ws.col.Info", preferences=preferences).splitlines()
        assert len(entries) == len(texts) == len(found) == len(infos) == capture.count
        return list(zip(entries, texts, found, infos))

    return both


def values(layer, fields):
    """The values of a frame, by the names of tshark. Digits and bits belong to the value before them."""
    names = (name.removeprefix(f"{layer}.") for name in fields if name.startswith(f"{layer}."))
    kept = {name for name in names if name not in APART}
    notes = {name for name in kept if set(fields[f"{layer}.{name}"]) == {""}}
    return {name for name in kept - notes if not any(name.startswith(f"{other}.") for other in kept)}


def same(got, value):
    number = int(got, 0) if got.startswith("0x") else float(got)
    # tshark prints a float of 32 bits with 6 digits. Phase currents in JSON are rounded to 1 mA.
    return math.isclose(number, value, rel_tol=1e-5 if isinstance(value, float) else 0, abs_tol=0.000501)


def check_rmd(entry, text, fields, info):
    layer = "motorlink.rmd"
    assert fields[f"{layer}.type"] == [TYPES[entry.get("direction")]]
    if entry["id"] != 0x280:
        assert fields[f"{layer}.motor"] == [str(entry["motor"])]
        assert int(fields[f"{layer}.code"][0], 0) == int(entry["data"][:2], 16)
    # Name, values and units, as people read them.
    assert text.endswith(f" {info}"), (text, info)
    expected = set()
    for name, value in entry.get("values", {}).items():
        name += UNITS[value.get("unit", "")]
        expected.add(name)
        [got] = fields[f"{layer}.{name}"]
        assert same(got, value["value"]), (entry, name, got)
        digits = fields.get(f"{layer}.{name}.digits")
        assert (digits or [str(int(got, 0))]) == [str(value["digits"])], (entry, name)
        if "names" in value:
            bits = {bit: set for bit, set in fields.items() if bit.startswith(f"{layer}.{name}.")}
            is_set = {bit.rpartition(".")[2].upper() for bit, [set] in bits.items() if set == "1"}
            assert is_set == set(value["names"]), (entry, bits)
    if entry.get("direction"):
        assert values(layer, fields) == expected, (entry, fields)
    return len(expected)


def check_st(tables, entry, text, fields, info):
    layer = "motorlink.st"
    assert fields[f"{layer}.type"] == [TYPES[entry["direction"]]]
    if entry["direction"] == "request":
        assert fields[f"{layer}.motor"] == [str(entry.get("motor", 0))]
    if entry["message"] != "UNKNOWN":
        assert fields[f"{layer}.message"] == [entry["message"]]
    decoded, expected = dict(entry.get("values", {})), set()
    if decoded.pop("error", None):
        code = decoded.pop("error_code")["value"]
        assert int(fields[f"{layer}.error"][0], 0) == code
        expected.add("error")
    if frame_code := decoded.pop("frame_code", None):
        assert int(fields[f"{layer}.code"][0], 0) == frame_code["value"]
    for name in ("register", "registers", "command"):
        if (names := decoded.pop(name, None)) is not None:
            key = name.rstrip("s")
            known = tables["commands" if key == "command" else "registers"]
            numbers = [int(number, 0) for number in fields.get(f"{layer}.{key}", [])]
            shown = [known.get(number, f"{number:#04x}") for number in numbers]
            assert shown == names["name"].split()
            expected.update([key] if shown else [])
    # The registers that neither table has are numbers.
    readings = [name for name in decoded if name in tables["registers"].values() or name.startswith("0x")]
    if readings and entry["message"] == "SET_REG":
        expected.add("register")
    for name, value in decoded.items():
        if name.startswith("0x"):
            continue
        if name in tables["registers"].values():
            key = f"reg.{name.lower()}"
        elif "value" in value:
            key = name + UNITS[value.get("unit", "")]
        elif value["name"]:
            key = name
        else:
            continue
        expected.add(key)
        got = fields[f"{layer}.{key}"]
        if "value" in value:
            assert len(got) == 1 and same(got[0], value["value"]), (entry, key, got)
        else:
            # Characters that a terminal does not show are replaced.
            [name], shown = got, value["name"]
            assert len(name) == len(shown) and all(b in (a, "\ufffd") for a, b in zip(name, shown)), (entry, got)
    digits = [int(digits) for digits in fields.get(f"{layer}.digits", [])]
    assert digits == [decoded[name]["digits"] for name in readings]
    if readings or "not plausible" in text or entry["message"] in ("NACK", "GET_REG", "EXECUTE_CMD"):
        # With names and units. Very large and very small floats differ in form.
        assert "e+" in info or "e-" in info or text.split(info[2:])[1:] == [""], (text, info)
    assert values(layer, fields) == expected, (entry, fields)
    return len(expected)


@pytest.mark.parametrize("told", [True, False])
def test_frames_of_rmd(both, sets, told):
    frames = sets["rmd"] + (sets["rmd told"] if told else [])
    checked = [check_rmd(*packet) for packet in both("rmd", on_can(frames, told), preferences=["motorlink.rmd.claim:all"])]
    assert len(checked) > 300 and sum(checked) > 100


def test_frames_of_st(run, both, sets):
    profile = "mcsdk-5.4"
    spec = json.loads(run("spec", "json").ended(0).out)["st"]
    tables = {
        "registers": {row["id"]: row["name"] for row in spec["registers"]},
        "commands": {row["number"]: row["name"] for row in spec["commands"]},
    }
    # decode finds the direction by the header, the dissector by the capture if it has one.
    frames = [frame for frame in sets[f"st {profile}"] if frame["sent"] != (frame["data"][0] in REPLIES)]
    capture = on_line(some(frames, 1 / 3))
    packets = both("st", capture, "--profile", profile, preferences=[f"motorlink.st.profile:{profile}"])
    checked = [check_st(tables, *packet) for packet in packets]
    assert len(checked) > 1500 and sum(checked) > 1500
