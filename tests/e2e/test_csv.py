"""`--every` with `--csv`: docs/CSV.md."""

import csv
import fcntl
import signal
import subprocess
import sys
import termios

import pytest

from program import environment, eventually


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_file_has_a_row_a_sample_with_units_and_the_table_stays_on_stdout(run, tmp_path):
    path = tmp_path / "run.csv"
    words = ("get", "SPEED_MEAS", "STATUS", "FLAGS", "--every", "5ms", "--count", 4, "--csv", path)
    table = run("st", "-p", "sim:", *words).ended(0).out
    rows = read(path)
    assert list(rows[0]) == ["t [s]", "SPEED_MEAS [rpm]", "STATUS", "FLAGS", "event"]
    assert len(rows) == 4 and len(table.splitlines()) == 6
    assert [(row["SPEED_MEAS [rpm]"], row["STATUS"], row["event"]) for row in rows] == 4 * [("0", "0", "")]
    times = [float(row["t [s]"]) for row in rows]
    # The first sample may be late: the data segment is configured before it.
    assert times == sorted(times) and times[-1] > 0.009


def test_rmd_values_have_their_units_and_raw_values_none(run, tmp_path):
    run("rmd", "-p", "sim:", "angle", "--every", "5ms", "--count", 1, "--csv", tmp_path / "a").ended(0)
    assert list(read(tmp_path / "a")[0]) == ["t [s]", "multi_turn_angle [°]", "single_turn_angle [°]", "event"]
    words = ("--raw", "status", "--every", "5ms", "--count", 1, "--csv", "-")
    header, row = csv.reader(run("rmd", "-p", "sim:", *words).ended(0).out.splitlines())
    assert header[1:4] == ["temperature", "voltage", "errors"] and header[-1] == "event"
    assert all(value.lstrip("-").isdigit() for value in row[1:-1])


def test_a_refused_value_is_empty(run, tmp_path):
    words = ("get", "SC_RS", "STATUS", "--every", "5ms", "--count", 2, "--csv", tmp_path / "a")
    run("st", "-p", "sim:", *words).ended(1)
    assert [(row["SC_RS"], row["STATUS"]) for row in read(tmp_path / "a")] == 2 * [("", "0")]


def test_a_file_that_exists_is_overwritten_with_force_only(run, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("precious")
    words = ("st", "-p", "sim:", "get", "STATUS", "--every", "5ms", "--count", 1, "--csv", path)
    message = run(*words).ended(2).err
    assert "exists already" in message and "--force" in message and path.read_text() == "precious"
    run(*words, "--force").ended(0)
    assert len(read(path)) == 1


def test_a_missing_folder_is_told(run, tmp_path):
    words = ("st", "-p", "sim:", "get", "STATUS", "--every", "5ms", "--count", 1, "--csv")
    missing = tmp_path / "none"
    message = run(*words, missing / "run.csv").ended(3).err
    assert f"cannot write `{missing}/run.csv`" in message
    assert f"make its folder first: `mkdir -p {missing}`" in message


def test_csv_and_json_do_not_share_stdout(run):
    words = ("get", "STATUS", "--every", "5ms", "--csv", "-", "--json")
    assert "both write to stdout" in run("st", "-p", "sim:", *words).ended(2).err


def test_a_full_disk_ends_a_recording_with_3(run):
    done = run("st", "-p", "sim:", "get", "STATUS", "--every", "5ms", "--csv", "/dev/full").ended(3)
    assert "No space left" in done.err


def test_a_recording_goes_on_when_stdout_is_closed_or_not_read(piped, motorlink, tmp_path):
    path, other = tmp_path / "run.csv", tmp_path / "other.csv"
    done = piped(f"st -p sim: get STATUS --every 2ms --count 300 --csv {path}", "| head -n 3 >/dev/null")
    assert (done.code, done.err) == (0, "")
    assert len(read(path)) == 300
    words = ["st", "-p", "sim:", "get", "STATUS", "--every", "2ms", "--count", "600", "--csv", other]
    with subprocess.Popen([motorlink, *words], stdout=subprocess.PIPE, env=environment()) as recording:
        fcntl.fcntl(recording.stdout, fcntl.F_SETPIPE_SZ, 4096)
        assert recording.wait(30) == 0
    assert len(read(other)) == 600


@pytest.mark.parametrize("words", [("--json",), ("--count", "1000000")])
def test_the_first_ctrl_c_ends_a_loop_whose_output_is_not_read(motorlink, words):
    loop = [motorlink, "st", "-p", "sim:", "get", "STATUS", "--every", "1ms", *words]
    with subprocess.Popen(loop, stdout=subprocess.PIPE, env=environment()) as running:
        # Two pages: it is full when the second one has data.
        size = fcntl.fcntl(running.stdout, fcntl.F_SETPIPE_SZ, 8192)

        def is_full():
            unread = fcntl.ioctl(running.stdout, termios.FIONREAD, bytes(4))
            return int.from_bytes(unread, sys.byteorder) > size // 2

        eventually(is_full, "a pipe that is full")
        running.send_signal(signal.SIGINT)
        assert running.wait(30) == (130 if "--count" in words else 0)


def test_a_count_ends_when_no_motor_answers(start, sim, tmp_path):
    drives = sim(st=("pty",))
    path = tmp_path / "run.csv"
    loop = start("st", "-p", drives.port("pty"), "--timeout", "100ms", "get", "STATUS", "--every", "20ms",
                 "--count", "100000", "--csv", path)
    loop.more_lines(4)
    drives.kill()
    assert loop.wait() == 3
    assert any("no sample for 10 s" in line for line in loop.err), loop.err
    assert len(read(path)) >= 2


def test_ctrl_c_leaves_whole_rows_and_tells_a_count_that_was_not_reached(start, tmp_path):
    for count, code in (((), 0), (("--count", 100_000), 130)):
        path = tmp_path / f"{code}.csv"
        watch = start("st", "-p", "sim:", "get", "STATUS", "--every", "5ms", *count, "--csv", path)
        watch.more_lines(4)
        watch.interrupt()
        assert watch.wait() == code
        assert path.read_text().endswith("\n") and len(read(path)) >= 2


def test_an_outage_is_in_the_file_and_the_header_comes_again(sim, start, tmp_path):
    drives = sim(rmd=())
    path = tmp_path / "run.csv"
    words = ("get", "SPEED_MEAS", "--every", "20ms", "--csv", path)
    watch = start("st", "-p", drives.st, "--timeout", "500ms", *words)
    watch.more_lines(4)
    drives.kill()
    watch.says("the line is lost")
    watch.says("trying again until Ctrl-C")
    sim(rmd=())
    watch.until(lambda: sum(line.split()[:1] == ["t"] for line in watch.out) == 2, "the header again")
    watch.says("the line is back")
    watch.more_lines(2)
    watch.interrupt()
    assert watch.wait() == 0
    rows = read(path)
    assert [row["event"] for row in rows if row["event"]] == ["outage", "back"]
    first = list(rows[0])[1]
    assert all((row[first] == "") == bool(row["event"]) for row in rows)
    assert [float(row["t [s]"]) for row in rows] == sorted(float(row["t [s]"]) for row in rows)
