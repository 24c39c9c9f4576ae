"""`motorlink spec`: files for other programs, against those programs and against proto."""

import json
import random
import re
import struct
import subprocess
from pathlib import Path

import cantools
import pytest
from jsonschema import Draft202012Validator

ROOT = Path(__file__).parents[2]
VECTORS = json.loads((ROOT / "vectors/rmd.json").read_text())
ST_VECTORS = json.loads((ROOT / "vectors/st.json").read_text())
IDS = (1, 2, 3, 4, 32)
#: Values that two commands have at different places, or in different units.
RENAMED = {
    ("reply", "read_multi_turn_angle", "angle"): "multi_turn_angle",
    ("reply", "read_single_turn_angle", "angle"): "single_turn_angle",
    ("request", "set_position", "angle"): "position_angle",
    ("request", "set_position_limited", "angle"): "position_angle",
    ("request", "set_single_turn_position", "angle"): "single_turn_position_angle",
    ("request", "set_single_turn_position_limited", "angle"): "single_turn_position_angle",
}


@pytest.fixture(scope="module")
def frames(motorlink):
    """Frames as proto encodes and decodes them: crates/spec/examples/rmd_frames.rs."""
    program = Path(motorlink).parent / "examples/rmd_frames"
    if not program.exists():
        pytest.fail(f"{program} is not built: `cargo build -p motorlink-spec --example rmd_frames`")

    def frames(lines):
        text = "".join(json.dumps(line) + "\n" for line in lines)
        done = subprocess.run([program], input=text, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr
        made = [json.loads(line) for line in done.stdout.splitlines()]
        assert len(made) == len(lines)
        return made

    return frames


@pytest.fixture(scope="module")
def tables(run):
    return json.loads(run("spec", "json").ended(0).out)


@pytest.fixture(scope="module")
def databases(run, tmp_path_factory):
    """The files of both directions, as cantools reads them."""
    folder = tmp_path_factory.mktemp("dbc")
    ids = ",".join(map(str, IDS))
    found = {}
    for direction in ("request", "reply"):
        path = folder / f"{direction}.dbc"
        run("spec", "dbc", "--id", ids, "--direction", direction, "-o", path).ended(0)
        found[direction] = cantools.database.load_file(path, strict=True)
    return found


def ends(field):
    """The least and the greatest digits that the bits of a field can have."""
    bits = field["bits"]
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if field["signed"] else (0, (1 << bits) - 1)


def samples(fields, limits, seed):
    """Digits for all fields: each field at its ends, 0 and -1, and random ones."""
    chance = random.Random(seed)
    least = {field["name"]: limits(field)[0] for field in fields}
    yield least
    yield {field["name"]: limits(field)[1] for field in fields}
    for field in fields:
        low, high = limits(field)
        for digits in {low, high, *(digits for digits in (0, -1, 1) if low <= digits <= high)}:
            yield {**least, field["name"]: digits}
    for _ in range(20):
        yield {field["name"]: chance.randint(*limits(field)) for field in fields}


def requested(field):
    """The least and the greatest digits of a request."""
    return field["range"]["least"], field["range"]["most"]


def in_frames(tables, limits):
    """Digits of every command in both directions: the row, the direction, and a line for proto."""
    for row in tables["rmd"]["commands"]:
        for kind in ("request", "reply"):
            for digits in samples(row[kind], limits, seed=f"{kind} {row['code']}"):
                yield row, {"kind": kind, "code": row["code"], "digits": digits}


def signals_of(message, field, code):
    """The signals with the bits of a field, the lowest first."""
    first, beyond = field["bit"], field["bit"] + field["bits"]
    found = [
        signal
        for signal in message.signals
        if first <= signal.start < beyond and (code is None or code in (signal.multiplexer_ids or ()))
    ]
    return sorted(found, key=lambda signal: signal.start)


def joined(signals, raw):
    """The digits of a field from those of its signals."""
    first = signals[0].start
    return sum(raw[signal.name] << (signal.start - first) for signal in signals)


def message_of(databases, kind, motor=1):
    return databases[kind].get_message_by_name(f"Motor{motor}_{kind.capitalize()}")


def test_both_files_have_every_command_by_its_name(databases, tables):
    expected = {row["code"]: row["name"] for row in tables["rmd"]["commands"]}
    assert set(expected) == {int(vector["command"], 16) for vector in VECTORS if vector["command"] != "torque4"}
    for kind in ("request", "reply"):
        for motor in IDS:
            message = message_of(databases, kind, motor)
            multiplexer = message.get_signal_by_name("command")
            assert (multiplexer.start, multiplexer.length, multiplexer.is_multiplexer) == (0, 8, True)
            assert {code: str(name) for code, name in multiplexer.choices.items()} == expected
            assert set(message.signal_tree[0]["command"]) == set(expected)


def test_messages_have_their_sender_and_their_receivers(databases):
    for kind, database in databases.items():
        assert [node.name for node in database.nodes] == ["Host", *(f"Motor{motor}" for motor in IDS)]
        for motor in IDS:
            message = message_of(databases, kind, motor)
            ends = ("Host", f"Motor{motor}") if kind == "request" else (f"Motor{motor}", "Host")
            assert (message.frame_id, message.length, message.is_extended_frame) == (0x140 + motor, 8, False)
            assert message.senders == [ends[0]] and message.receivers == {ends[1]}
            assert all(signal.comment for signal in message.signals) and message.comment


def test_signals_have_names_units_and_words(databases, tables):
    for row in tables["rmd"]["commands"]:
        for kind in ("request", "reply"):
            message = message_of(databases, kind)
            for field in row[kind]:
                signals = signals_of(message, field, row["code"])
                assert sum(signal.length for signal in signals) == field["bits"]
                if "flags" in field:
                    names = {signal.start - field["bit"]: signal for signal in signals}
                    for flag in field["flags"]:
                        signal = names[flag["bit"]]
                        assert signal.name == f"{field['name']}_{flag['name'].lower()}"
                        assert str(signal.choices[1]) == flag["name"].lower().replace("_", " ")
                    continue
                (signal,) = signals
                name = RENAMED.get((kind, row["name"], field["name"]), field["name"])
                assert (signal.name, signal.is_signed, signal.scale) == (name, field["signed"], field["digit"])
                unit = field["unit"].replace("°", "deg").replace("²", "^2")
                assert (signal.unit or "") == unit and signal.byte_order == "little_endian"
                words = {value["number"]: value["name"] for value in field.get("values", [])}
                assert {n: str(word) for n, word in (signal.choices or {}).items()} == words


def test_cantools_decodes_what_proto_encodes(databases, tables, frames):
    lines = list(in_frames(tables, ends))
    assert len(lines) > 1000
    for (row, line), made in zip(lines, frames([line for _, line in lines])):
        assert made["digits"] == line["digits"]
        kind, data = line["kind"], bytes.fromhex(made["data"])
        message = message_of(databases, kind)
        raw = message.decode(data, decode_choices=False, scaling=False)
        scaled = message.decode(data, decode_choices=False)
        names = message.decode(data)
        assert str(names["command"]) == row["name"]
        seen = {"command"}
        for field in row[kind]:
            signals = signals_of(message, field, row["code"])
            seen.update(signal.name for signal in signals)
            assert joined(signals, raw) == made["digits"][field["name"]], (line, made)
            if len(signals) == 1:
                value = made["values"][field["name"]]
                assert scaled[signals[0].name] == pytest.approx(value, rel=1e-12, abs=1e-12)
        assert set(raw) == seen


def test_proto_decodes_what_cantools_encodes(databases, tables, frames):
    """In digits and in physical values, within the ranges of requests."""
    lines = list(in_frames(tables, requested))
    made = frames([line for _, line in lines])
    encoded = []
    for (row, line), wanted in zip(lines, made):
        kind = line["kind"]
        message = message_of(databases, kind)
        raw, scaled = {"command": row["code"]}, {"command": row["name"]}
        for field in row[kind]:
            signals = signals_of(message, field, row["code"])
            digits = wanted["digits"][field["name"]]
            for signal in signals:
                bits = digits >> (signal.start - field["bit"])
                part = digits if len(signals) == 1 else bits & ((1 << signal.length) - 1)
                raw[signal.name] = part
                scaled[signal.name] = wanted["values"][field["name"]] if len(signals) == 1 else part
        encoded.append((line, message.encode(raw, scaling=False)))
        # A number of 64 bits has 53 exact ones.
        if all(abs(digits) < 1 << 53 for digits in wanted["digits"].values()):
            encoded.append((line, message.encode(scaled)))
    sent = [{"kind": line["kind"], "data": data.hex()} for line, data in encoded]
    for (line, _), understood in zip(encoded, frames(sent)):
        assert understood["digits"] == line["digits"]


def test_cantools_refuses_requests_that_proto_refuses(databases, tables):
    beyond = 0
    for row in tables["rmd"]["commands"]:
        message = message_of(databases, "request")
        middle = {field["name"]: field["range"]["most"] for field in row["request"]}
        for field in row["request"]:
            least, most = requested(field)
            for digits in (least - 1, most + 1):
                if not ends(field)[0] <= digits <= ends(field)[1]:
                    continue
                values = {"command": row["name"]}
                for other in row["request"]:
                    (signal,) = signals_of(message, other, row["code"])
                    wanted = digits if other is field else middle[other["name"]]
                    values[signal.name] = wanted * other["digit"]
                with pytest.raises(cantools.database.EncodeError):
                    message.encode(values)
                beyond += 1
    assert beyond >= 6


def test_the_message_to_four_motors_is_a_request(databases, tables, frames):
    assert 0x280 not in [message.frame_id for message in databases["reply"].messages]
    message = databases["request"].get_message_by_frame_id(0x280)
    fields = tables["rmd"]["torque4"]["request"]
    assert message.name == "SetTorque4" and message.senders == ["Host"]
    assert [signal.receivers for signal in message.signals] == [[f"Motor{n}"] for n in range(1, 5)]
    lines = [{"kind": "torque4", "digits": digits} for digits in samples(fields, ends, 4)]
    for made in frames(lines):
        data = bytes.fromhex(made["data"])
        assert message.decode(data, scaling=False) == made["digits"]
        assert message.decode(data) == pytest.approx(made["values"])
        if max(map(abs, made["digits"].values())) <= 2000:
            assert message.encode(made["values"]) == data


def test_a_file_has_the_motors_that_are_asked_for(run):
    for ids, motors in (((), 1), (("--id", "1..4"), 4), (("--all",), 32)):
        assert run("spec", "dbc", *ids).ended(0).out.count("\nBO_ 3") == motors
    done = run("spec", "dbc").ended(0)
    assert "describes replies" in done.err and "--direction request" in done.err
    assert not run("spec", "dbc", "--direction", "reply").ended(0).err


def test_words_that_make_no_file(run, tmp_path):
    for words, code, text in (
        (("--id", "0"), 2, "ID from 1 to 32"),
        (("--id", "4..1"), 2, "ID from 1 to 32"),
        (("--id", "1", "--all"), 2, "cannot be used with"),
        (("--direction", "both"), 2, "request, reply"),
        (("-o", tmp_path / "none" / "a.dbc"), 3, "No such file"),
    ):
        done = run("spec", "dbc", *words).ended(code)
        assert text in done.err and not done.out
    assert not any(tmp_path.iterdir())


def test_a_file_is_replaced_only_on_demand(run, tmp_path):
    path = tmp_path / "file"
    path.write_text("mine")
    done = run("spec", "json", "-o", path).ended(2)
    assert "exists; nothing was written" in done.err and "--force" in done.err
    assert path.read_text() == "mine"
    run("spec", "json", "-o", path, "--force").ended(0)
    assert path.read_text() == run("spec", "json").ended(0).out
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_the_tables_follow_their_schema(tables):
    schema = json.loads((ROOT / "docs/spec.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    Draft202012Validator(schema).validate(tables)
    assert tables["version"] == schema["properties"]["version"]["const"]


def built(tables, command, motor, values):
    """Identifier and bytes of a request, from the tables alone. `values` are in physical units."""
    rmd = tables["rmd"]
    row = next(row for row in rmd["commands"] if row["name"] == command)
    data = bytearray(rmd["frame"]["bytes"])
    data[rmd["frame"]["code_at"]] = row["code"]
    assert {field["name"] for field in row["request"]} == set(values)
    for field in row["request"]:
        wanted = values[field["name"]]
        numbers = {value["name"]: value["number"] for value in field.get("values", [])}
        digits = numbers[wanted] if numbers else round(wanted / field["digit"])
        assert field["range"]["least"] <= digits <= field["range"]["most"]
        part = digits.to_bytes(field["bytes"], rmd["frame"]["byte_order"], signed=field["signed"])
        data[field["byte"] : field["byte"] + field["bytes"]] = part
    return rmd["identifier_base"] + motor, bytes(data)


def test_another_generator_can_build_every_request(tables, frames):
    names = {"direction": ["clockwise", "counterclockwise"]}
    lines, made = [], []
    for row in tables["rmd"]["commands"]:
        for digits in samples(row["request"], requested, seed=row["name"]):
            if digits.get("direction", 0) > 1:
                continue
            values = {
                field["name"]: names["direction"][digits["direction"]]
                if field["name"] in names
                else digits[field["name"]] * field["digit"]
                for field in row["request"]
            }
            lines.append({"kind": "request", "code": row["code"], "digits": digits})
            made.append(built(tables, row["name"], 7, values))
    assert len({line["code"] for line in lines}) == len(tables["rmd"]["commands"]) and len(lines) > 250
    for encoded, (identifier, data) in zip(frames(lines), made):
        assert (identifier, data.hex()) == (0x147, encoded["data"])


FORMATS = {"i8": "b", "u8": "B", "i16": "h", "u16": "H", "i32": "i", "u32": "I", "f32": "f"}


def numbers(payload, fields):
    """The numbers of an ST payload. `fields` has their names without units."""
    data = bytearray(sum(value["bytes"] for value in payload["values"]))
    for value in payload["values"]:
        wanted = fields[value["name"].split("_")[0]]
        struct.pack_into("<" + FORMATS[value["type"]], data, value["byte"], wanted)
    return bytes(data)


def st_frame(tables, vector):
    """The command of a vector, from the tables alone."""
    st, fields = tables["st"], vector["fields"]
    profiles = st["profiles"] if vector["profile"] == "both" else [vector["profile"]]
    (row,) = (
        row for row in st["frame_codes"] if row["name"] == vector["code"] and set(profiles) <= set(row["profiles"])
    )
    data = numbers(row["request"], fields)
    rest = {
        "register": lambda: bytes([fields["register"]]),
        "register-and-value": lambda: bytes([fields["register"]]) + bytes.fromhex(fields["value"]),
        "command": lambda: bytes([fields["command"]]),
        "values-and-registers": lambda: bytes.fromhex(fields["registers"]),
        "bytes": lambda: bytes.fromhex(fields["steps"]),
        "values": bytes,
    }
    data += rest[row["request"]["content"]]()
    header = row["number"] | vector["motor"] << st["frame"]["code_bits"]
    frame = bytes([header, len(data)]) + data
    total = sum(frame)
    return frame + bytes([(total >> 8) + total & 0xFF])


def test_another_generator_can_build_every_frame_of_st(tables):
    for vector in ST_VECTORS:
        assert st_frame(tables, vector).hex() == vector["request"], vector
    assert {row["name"] for row in tables["st"]["frame_codes"]} == {vector["code"] for vector in ST_VECTORS}


def test_the_payloads_of_replies_have_the_numbers_of_the_vectors(tables):
    rows = {row["name"]: row for row in tables["st"]["frame_codes"]}
    seen = set()
    for vector in ST_VECTORS:
        reply = rows[vector["code"]]["reply"]
        data = bytes.fromhex(vector.get("reply", ""))
        if data[:1] != bytes([tables["st"]["reply_headers"]["acknowledge"]]) or reply["content"] != "values":
            continue
        assert numbers(reply, vector["answer"]) == data[2:-1], vector
        seen.add(vector["code"])
    assert {"GET_REVUP_DATA", "SET_RAMP", "SET_REG"} <= seen


def test_the_tables_have_the_registers_of_the_program(tables, run):
    listed = {row["id"]: row for row in run("st", "registers", "--json").ended(0).lines}
    registers = tables["st"]["registers"]
    assert [row["id"] for row in registers] == sorted(listed)
    features = {row["name"]: row["description"] for row in tables["st"]["features"]}
    for row in registers:
        other = listed[row["id"]]
        assert (row["name"], row["description"], row["access"]) == (other["name"], other["doc"], other["access"])
        assert features[row["feature"]] == other["feature"]
        assert (row["origin"] == "firmware") == (other["profile"] == "mcsdk-5.4")
        assert row["profiles"]["mcsdk-5.4"]["type"] == other["mcsdk_type"]
        assert ("spec" in row["profiles"]) == (row["origin"] == "document")
        if row["access"] in ("R", "RW") and "spec" in row["profiles"]:
            assert row["profiles"]["spec"]["read_bytes"] == int(other["type"][1:]) // 8


def test_the_page_has_every_row_of_the_tables(tables, run):
    page = run("spec", "markdown").ended(0).out
    st, rmd = tables["st"], tables["rmd"]
    tabled = [*st["frame_codes"], *st["errors"], *st["commands"], *st["states"], *st["control_modes"]]
    tabled += [*st["faults"], *st["registers"]]
    for row in tabled:
        line = rf"^\| (0x[0-9A-F]+|\d+) \| `{row['name']}` \|.*{re.escape(row['description'])} \|$"
        assert re.search(line, page, re.M), row
    for row in rmd["commands"]:
        assert f"| 0x{row['code']:02X} | `{row['name']}` | {row['title']} | {row['description']} |" in page
        fields = [(row["name"], field) for field in row["request"]]
        fields += [(row["reply_name"], field) for field in row["reply"] if not row["echo"]]
        for name, field in fields:
            line = f"| `{name}` | `{field['name']}` | DATA[{field['byte']}]"
            assert line in page and f"| {field['description']} |" in page
