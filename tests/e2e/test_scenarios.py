"""Scenarios: those that ship, and what a person meets who writes one."""

import csv
import math
import os
import resource
import subprocess
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
SHIPPED = sorted((REPOSITORY / "scenarios").glob("*.toml"))
assert len(SHIPPED) >= 5
PICTURES = REPOSITORY / "docs" / "pictures"


@pytest.fixture
def write(tmp_path):
    """Writes a scenario with a motor, a second long: `write("[[event]]..")`."""

    def write(text):
        path = tmp_path / "scenario.toml"
        path.write_text(f'title = "A test"\nduration = 1.0\n[[st.motor]]\npreset = "mains"\n{text}')
        return path

    return write


def columns(path):
    """A CSV by column."""
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    return {name: [float(row[n]) for row in rows] for n, name in enumerate(header)}


# What ships.


@pytest.mark.parametrize("scenario", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_scenario_comes_as_expected_and_as_in_its_picture(run, tmp_path, scenario):
    files = {kind: tmp_path / f"run.{kind}" for kind in ("csv", "svg")}
    arguments = ("--csv", files["csv"], "--plot", files["svg"])
    told = run("sim", "run", scenario, "--json", *arguments).ended(0).json
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
    picture = PICTURES / f"{scenario.stem}.svg"
    assert picture.read_bytes() == files["svg"].read_bytes(), f"`make pictures` draws {picture.name} anew"


# Messages.


def test_a_failed_expectation_and_a_refusal_that_was_not_announced_are_said(run, write):
    scenario = write("""
        [[event]]
        at = 0.5
        st = 1
        send = "set"
        register = "SPEED_MEAS"
        value = 3
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
    assert "at 0.5 s st1 refused `SPEED_MEAS 3` with SET_READ_ONLY" in text.err
    told = run("sim", "run", scenario, "--json").ended(1).json
    assert [one["holds"] for one in told["expectations"]] == [False, True]
    assert told["expectations"][0]["found"] == found
    assert told["refusals"][0]["reply"] == "SET_READ_ONLY"


# What is refused.


def test_a_scenario_that_cannot_be_is_refused_with_its_place(run, write):
    for text, said in (
        ("[[evnt]]", "evnt"),
        ("[[panel]]\nsignals = ['st1.sped_rpm']", "did you mean `st1.speed_rpm`"),
        ("[[load_profile]]\nst = 1\nfile = 'none.csv'", "none.csv"),
    ):
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


@pytest.mark.parametrize("way", ["path", "hard link", "chain"])
def test_a_scenario_is_never_overwritten(run, write, tmp_path, way):
    scenario = write(PANEL)
    other = tmp_path / "other"
    match way:
        case "path":
            (tmp_path / "folder").mkdir()
            other = tmp_path / "folder" / ".." / scenario.name
        case "hard link":
            other.hardlink_to(scenario)
        case "chain":
            (tmp_path / "between").symlink_to(scenario)
            other.symlink_to("between")
    before = scenario.read_bytes()
    refused = run("sim", "run", scenario, "--plot", other).ended(2)
    assert str(other) in refused.err and "which is read" in refused.err
    assert refused.out == "" and scenario.read_bytes() == before


def test_a_load_profile_is_never_overwritten(run, write, tmp_path):
    load = tmp_path / "pump.csv"
    load.write_text("t_s,newton_metres\n0,0\n1,0.1\n")
    scenario = write("[[load_profile]]\nst = 1\nfile = 'pump.csv'")
    before = load.read_bytes()
    assert "which is read" in run("sim", "run", scenario, "--csv", load).ended(2).err
    assert load.read_bytes() == before


@pytest.mark.parametrize("way", ["itself", "symlink", "dangling"])
def test_an_output_is_never_overwritten_with_another(run, write, tmp_path, way):
    csv_file, svg = tmp_path / "run", tmp_path / "link"
    match way:
        case "itself":
            svg = csv_file
        case "symlink":
            csv_file.write_text("old")
            svg.symlink_to("run")
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


def test_a_full_disk_keeps_the_exit_code_of_what_happened(run, write):
    full = run("sim", "run", write(PANEL), "--csv", "/dev/full").ended(3)
    assert "cannot write `/dev/full`" in full.err and "state hash" in full.out
    failed = run("sim", "run", write(FAILING), "--plot", "/dev/full").ended(1)
    assert "cannot write `/dev/full`" in failed.err and "it turns: st1.speed_rpm" in failed.err


@pytest.mark.parametrize("options", [(), ("--json",), ("--plot", "-")])
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
