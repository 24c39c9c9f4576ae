"""Scenarios: those that ship, and what a person meets who writes one."""

import csv
import math
import os
import resource
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

REPOSITORY = Path(__file__).parents[2]
SHIPPED = sorted((REPOSITORY / "scenarios").glob("*.toml"))
PICTURES = REPOSITORY / "docs" / "pictures"
SVG = "{http://www.w3.org/2000/svg}"
EVENT = "#A3ACB6"


@pytest.fixture
def write(tmp_path):
    """Writes a scenario with a motor, a second long: `write("[[event]]..")`."""

    def write(text, motor='[[st.motor]]\npreset = "mains"'):
        path = tmp_path / "scenario.toml"
        path.write_text(f'title = "A test"\nduration = 1.0\n{motor}\n{text}')
        return path

    return write


def columns(path):
    """A CSV by column."""
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    return {name: [float(row[n]) for row in rows] for n, name in enumerate(header)}


def texts(path):
    """What a picture says; fails unless it is an SVG with lines."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == f"{SVG}svg"
    assert all(root.get(name) for name in ("width", "height", "viewBox"))
    assert list(root.iter(f"{SVG}polyline"))
    return [(text.text or "").strip() for text in root.iter(f"{SVG}text")]


# What ships.


def test_five_scenarios_ship():
    assert len(SHIPPED) >= 5


@pytest.mark.parametrize("scenario", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_scenario_comes_as_expected_and_always_the_same(run, tmp_path, scenario):
    files = {kind: tmp_path / f"run.{kind}" for kind in ("csv", "svg")}
    arguments = ("--csv", files["csv"], "--plot", files["svg"])
    first = run("sim", "run", scenario, "--json", *arguments, within=120).ended(0)
    told = first.json
    assert told["ok"] and told["refusals"] == []
    assert told["expectations"] and all(one["holds"] for one in told["expectations"])
    assert len(told["state_hash"]) == 16 and int(told["state_hash"], 16)

    samples = columns(files["csv"])
    assert len(samples["time_s"]) == told["samples"]
    assert samples["time_s"][0] == 0 and samples["time_s"][-1] == told["duration"]["value"]
    for drive, signals in told["final"].items():
        for name, value in signals.items():
            column = samples[f"{drive}.{name}"]
            assert all(map(math.isfinite, column)), name
            assert isinstance(value, str) or math.isclose(column[-1], value, rel_tol=1e-6), name
    assert told["title"] in texts(files["svg"])

    before = {kind: path.read_bytes() for kind, path in files.items()}
    again = run("sim", "run", scenario, "--json", *arguments, within=120).ended(0)
    assert again.out == first.out
    assert {kind: path.read_bytes() for kind, path in files.items()} == before
    picture = PICTURES / f"{scenario.stem}.svg"
    assert picture.read_bytes() == before["svg"], f"`make pictures` draws {picture.name} anew"


def shapes(path):
    """Texts, opaque rectangles and lines of events of a picture in the order in which they are drawn:
    kind, left, top, right, bottom."""
    for shape in ElementTree.parse(path).getroot():
        kind = shape.tag.removeprefix(SVG)
        if kind == "text":
            size, text = float(shape.get("font-size")), (shape.text or "").strip()
            wide, x, y = 0.5 * size * len(text), float(shape.get("x")), float(shape.get("y"))
            x -= {"start": 0, "middle": wide / 2, "end": wide}[shape.get("text-anchor")]
            # The part of letters that is certainly black.
            yield "text", x, y - size / 5, x + wide, y + size / 5, text
        elif kind == "rect" and shape.get("opacity") == "1" and shape.get("fill") != "none":
            x, y = float(shape.get("x")), float(shape.get("y"))
            yield "rect", x, y, x + float(shape.get("width")), y + float(shape.get("height")), ""
        elif kind == "polyline" and shape.get("stroke") == EVENT:
            points = [tuple(map(float, point.split(","))) for point in shape.get("points").split()]
            (left, top), (right, bottom) = min(points), max(points)
            if left == right:
                yield "line", left, top, right, bottom, ""


@pytest.mark.parametrize("picture", sorted(PICTURES.glob("*.svg")), ids=lambda path: path.stem)
def test_no_line_of_an_event_crosses_a_text(picture):
    drawn = list(shapes(picture))
    lines = [(n, shape) for n, shape in enumerate(drawn) if shape[0] == "line"]
    assert lines and len(drawn) > 20
    for n, (kind, left, top, right, bottom, text) in enumerate(drawn):
        if kind != "text":
            continue
        for k, (_, x, high, _, low, _) in lines:
            if not (left < x < right and high < bottom and top < low):
                continue
            hidden = [
                shape
                for shape in drawn[k + 1 : n]
                if shape[0] == "rect" and shape[1] < x < shape[3] and shape[2] < top and bottom < shape[4]
            ]
            assert k < n and hidden, f"a line crosses `{text}`"


# Messages.


def test_a_failed_expectation_says_by_how_much_and_when(run, write):
    scenario = write("""
        [[expect]]
        why = "it turns by itself"
        signal = "st1.speed_rpm"
        between = [0.25, 1.0]
        min = 300
        [[expect]]
        why = "it stays at rest"
        signal = "st1.status"
        is = "IDLE"
    """)
    text = run("sim", "run", scenario).ended(1)
    found = "0 rpm at 0.25 s, expected at least 300 rpm: off by 300 rpm"
    assert f"it turns by itself: st1.speed_rpm {found}" in text.err
    assert "1 of 2 expectations hold" in text.out and "it stays at rest" not in text.err
    told = run("sim", "run", scenario, "--json").ended(1).json
    assert [one["holds"] for one in told["expectations"]] == [False, True]
    assert told["expectations"][0]["found"] == found


def test_a_refusal_that_was_not_announced_fails_the_run(run, write):
    event = """
        [[event]]
        at = 0.5
        st = 1
        send = "set"
        register = "SPEED_MEAS"
        value = 3
    """
    refused = run("sim", "run", write(event)).ended(1)
    assert "at 0.5 s st1 refused `SPEED_MEAS 3` with SET_READ_ONLY" in refused.err
    run("sim", "run", write(event + 'refused = "SET_READ_ONLY"')).ended(0)
    other = run("sim", "run", write(event + 'refused = "WRONG_SET"'), "--json").ended(1)
    assert other.json["refusals"][0]["reply"] == "SET_READ_ONLY"


def test_a_load_comes_from_a_file_beside_the_scenario(run, write, tmp_path):
    (tmp_path / "pump.csv").write_text("t_s,newton_metres\n0,0\n1,0.1\n")
    scenario = write(
        """
        [[load_profile]]
        rmd = 1
        file = "pump.csv"
        [[event]]
        at = 0
        rmd = 1
        send = "speed"
        speed_dps = 720
        [[expect]]
        why = "four fifths of it in four fifths of the time"
        signal = "rmd1.load_newton_metres"
        between = [0.2, 1.0]
        of = "swing"
        value = 0.08
        within = 1e-6
        """,
        motor="[[rmd.motor]]",
    )
    run("sim", "run", scenario).ended(0)
    (tmp_path / "pump.csv").write_text("t_s,newton_metres\n0,0\n0,0.8\n")
    assert "pump.csv: line 3" in run("sim", "run", scenario).ended(2).err


def test_events_stand_in_the_picture(run, write, tmp_path):
    scenario = write("""
        [[event]]
        at = 0.5
        st = 1
        world = "load"
        newton_metres = 0.1
        label = "a <heavy> load"
        [[panel]]
        title = "State & faults"
        signals = ["st1.status", "st1.faults"]
        [[panel]]
        signals = ["st1.bus_volts"]
    """)
    run("sim", "run", scenario, "--plot", tmp_path / "run.svg").ended(0)
    said = texts(tmp_path / "run.svg")
    for text in ("A test", "a <heavy> load", "State & faults", "IDLE", "none", "Voltage (V)", "time (s)"):
        assert text in said, said


# What is refused.


@pytest.mark.parametrize(
    "text, said",
    [
        ("[[evnt]]", "evnt"),
        ("[[panel]]\nsignals = ['st1.sped_rpm']", "did you mean `st1.speed_rpm`"),
        ("[[event]]\nat = 2\nst = 1\nsend = 'start'", "event 1: at 2 s: the run lasts"),
        ("[[event]]\nat = nan\nst = 1\nsend = 'start'", "the run lasts"),
        ("[[event]]\nat = 0\nst = 3\nsend = 'start'", "the motors are: st1"),
        ("[[event]]\nat = 0\nst = 1\nsend = 'start'\nspeed_rpm = 3", "speed_rpm"),
        ("[[event]]\nat = 0\nst = 1\nworld = 'load'\nnewton_metres = inf", "newton_metres"),
        ("[[event]]\nat = 0\nst = 1\nsend = 'set'\nregister = 'SPEED_MES'\nvalue = 1", "SPEED_MEAS"),
        ("[[expect]]\nwhy = ''\nsignal = 'st1.speed_rpm'\nat = 3\nmin = 0", "expect 1"),
        ("[[load_profile]]\nst = 1\nfile = 'none.csv'", "none.csv"),
        ("title = 'twice'", "title"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused_with_its_place(run, write, text, said):
    refused = run("sim", "run", write(text)).ended(2)
    assert said in refused.err and "scenario.toml" in refused.err
    assert refused.out == ""


def test_files_that_cannot_be_read_or_written_are_named(run, write, tmp_path):
    assert "none.toml" in run("sim", "run", tmp_path / "none.toml").ended(2).err
    lost = tmp_path / "lost" / "run.csv"
    assert "run.csv" in run("sim", "run", write(""), "--csv", lost).ended(3).err
    nothing = run("sim", "run", write(""), "--plot", tmp_path / "run.svg").ended(2)
    assert "[[panel]]" in nothing.err
    assert not (tmp_path / "run.svg").exists()


# What is written, and what is left alone.

PANEL = "[[panel]]\nsignals = ['st1.speed_rpm']"
FAILING = PANEL + "\n[[expect]]\nwhy = 'it turns'\nsignal = 'st1.speed_rpm'\nmin = 3"


@pytest.mark.parametrize("option", ["--csv", "--plot"])
@pytest.mark.parametrize("way", ["itself", "path", "symlink", "hard link", "chain"])
def test_a_scenario_is_never_overwritten(run, write, tmp_path, option, way):
    scenario = write(PANEL)
    other = tmp_path / "other"
    match way:
        case "itself":
            other = scenario
        case "path":
            (tmp_path / "folder").mkdir()
            other = tmp_path / "folder" / ".." / scenario.name
        case "symlink":
            other.symlink_to(scenario.name)
        case "hard link":
            other.hardlink_to(scenario)
        case "chain":
            (tmp_path / "between").symlink_to(scenario)
            other.symlink_to("between")
    before = scenario.read_bytes()
    refused = run("sim", "run", scenario, option, other).ended(2)
    assert str(other) in refused.err and "which is read" in refused.err
    assert refused.out == "" and scenario.read_bytes() == before


def test_a_load_profile_is_never_overwritten(run, write, tmp_path):
    load = tmp_path / "pump.csv"
    load.write_text("t_s,newton_metres\n0,0\n1,0.1\n")
    scenario = write("[[load_profile]]\nst = 1\nfile = 'pump.csv'")
    before = load.read_bytes()
    assert "which is read" in run("sim", "run", scenario, "--csv", load).ended(2).err
    assert load.read_bytes() == before


@pytest.mark.parametrize("way", ["itself", "path", "symlink", "hard link", "dangling"])
def test_an_output_is_never_overwritten_with_another(run, write, tmp_path, way):
    csv_file, svg = tmp_path / "run", tmp_path / "link"
    match way:
        case "itself":
            svg = csv_file
        case "path":
            (tmp_path / "folder").mkdir()
            svg = tmp_path / "folder" / ".." / "run"
        case "symlink":
            csv_file.write_text("old")
            svg.symlink_to("run")
        case "hard link":
            csv_file.write_text("old")
            svg.hardlink_to(csv_file)
        case "dangling":
            svg.symlink_to("run")
    files = ("--csv", csv_file, "--plot", svg)
    assert "is the same file as" in run("sim", "run", write(PANEL), *files).ended(2).err
    assert not csv_file.exists() or csv_file.read_text() == "old"


def test_a_link_stays_a_link_and_a_mode_stays_a_mode(run, write, tmp_path):
    real, link = tmp_path / "real.csv", tmp_path / "link.csv"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to("real.csv")
    run("sim", "run", write(""), "--csv", link).ended(0)
    assert link.is_symlink() and len(columns(real)["time_s"]) == 1001
    assert real.stat().st_mode & 0o777 == 0o640
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.csv", "real.csv", "scenario.toml"]


def test_a_minus_is_stdout(run, write, tmp_path):
    scenario = write(PANEL)
    run("sim", "run", scenario, "--csv", tmp_path / "a.csv", "--plot", tmp_path / "a.svg").ended(0)
    csv_out = run("sim", "run", scenario, "--csv", "-").ended(0)
    assert csv_out.out == (tmp_path / "a.csv").read_text()
    assert "state hash" in csv_out.err, "the report is on stderr then"
    assert run("sim", "run", scenario, "--plot", "-").ended(0).out == (tmp_path / "a.svg").read_text()
    both = run("sim", "run", scenario, "--csv", "-", "--plot", "-").ended(2)
    assert "stdout" in both.err and both.out == ""
    json_too = run("sim", "run", scenario, "--csv", "-", "--json").ended(2)
    assert "stdout" in json_too.err and json_too.out == ""


@pytest.mark.parametrize("option", ["--csv", "--plot"])
def test_a_full_disk_keeps_the_exit_code_of_what_happened(run, write, option):
    full = run("sim", "run", write(PANEL), option, "/dev/full").ended(3)
    assert "cannot write `/dev/full`" in full.err and "state hash" in full.out
    failed = run("sim", "run", write(FAILING), option, "/dev/full").ended(1)
    assert "cannot write `/dev/full`" in failed.err and "it turns: st1.speed_rpm" in failed.err


@pytest.mark.parametrize("options", [(), ("--json",), ("--csv", "-"), ("--plot", "-")])
@pytest.mark.parametrize("out", ["full", "closed"])
def test_a_stdout_that_fails_keeps_the_exit_code_of_what_happened(motorlink, write, options, out):
    for text, full, closed in ((PANEL, 3, 0), (FAILING, 1, 1)):
        if out == "full":
            stdout = os.open("/dev/full", os.O_WRONLY)
        else:
            reader, stdout = os.pipe()
            os.close(reader)
        command = [motorlink, "sim", "run", write(text), *options]
        done = subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, timeout=60)
        os.close(stdout)
        assert done.returncode == (full if out == "full" else closed), done.stderr
        if text is FAILING:
            assert "it turns: st1.speed_rpm" in done.stderr and "stdout" in done.stderr
        elif out == "full":
            assert "stdout" in done.stderr


def test_a_failed_write_keeps_the_old_output(motorlink, write, tmp_path):
    """A file may have 1 KiB; more is an error, as on a full disk."""
    old = tmp_path / "run.csv"
    old.write_text("old")
    command = [motorlink, "sim", "run", write(""), "--csv", old]

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))

    done = subprocess.run(command, capture_output=True, text=True, timeout=60, preexec_fn=limit)
    assert done.returncode == 3 and "run.csv" in done.stderr, done.stderr
    assert old.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.csv", "scenario.toml"]
