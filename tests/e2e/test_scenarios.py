"""Scenarios: those that ship, and what a person meets who writes one."""

import csv
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

REPOSITORY = Path(__file__).parents[2]
SHIPPED = sorted((REPOSITORY / "scenarios").glob("*.toml"))
PICTURES = REPOSITORY / "docs" / "pictures"
SVG = "{http://www.w3.org/2000/svg}"


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


# What is told.


def test_a_failed_expectation_says_by_how_much_and_when(run, write):
    scenario = write("""
        [[expect]]
        why = "it turns by itself"
        signal = "st1.speed_rpm"
        between = [0.25, 1.0]
        min = 300
        [[expect]]
        why = "nobody starts it"
        signal = "st1.status"
        is = "IDLE"
    """)
    text = run("sim", "run", scenario).ended(1)
    found = "0 rpm at 0.25 s, 300 rpm outside at least 300 rpm"
    assert f"it turns by itself: st1.speed_rpm {found}" in text.err
    assert "1 of 2 expectations hold" in text.out and "nobody starts it" not in text.err
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
        ("[[event]]\nat = 0\nst = 3\nsend = 'start'", "these are: st1"),
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
