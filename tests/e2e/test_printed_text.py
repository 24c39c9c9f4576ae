"""Control characters in texts from outside never reach a terminal, a picture or a table."""

import json
import os
import pty
import subprocess
import unicodedata
from xml.etree import ElementTree

import pytest
from peers import device
from st_wire import ACK, frame

GET_BOARD_INFO, FLAGS = 0x06, 1

# Clears a screen (with two kinds of CSI), sets a title, reverses text, fakes a line.
HOSTILE = "\x1b[2J\x9b2J\x1b]0;title\x07\u202e\u2066\r\nerror: fake"
# The same in a string of TOML.
IN_TOML = json.dumps(HOSTILE)[1:-1]

PARTS = {
    "title": 'title = "{}"\nduration = 0.1\n[[rmd.motor]]',
    "label": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[event]]\nat = 0\nrmd = 1\nsend = "off"\nlabel = "{}"',
    "panel": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[panel]]\ntitle = "{}"\nsignals = ["rmd1.speed_dps"]',
    "why": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[expect]]\nwhy = "{}"\nsignal = "rmd1.speed_dps"\nmin = 3',
    "is": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[expect]]\nwhy = ""\nsignal = "rmd1.mode"\nis = "{}"',
    "key": 'title = ""\nduration = 0.1\n"{}" = 3\n[[rmd.motor]]',
    "key of an event": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[event]]\nat = 0\nrmd = 1\nsend = "off"\n"{}" = 1',
    "key of a motor": 'title = ""\nduration = 0.1\n[[rmd.motor]]\nplant."{}" = 1',
    "signal": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[panel]]\nsignals = ["{}"]',
    "command": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[event]]\nat = 0\nrmd = 1\nworld = "{}"',
    "preset": 'title = ""\nduration = 0.1\n[[rmd.motor]]\npreset = "{}"',
    "file": 'title = ""\nduration = 0.1\n[[rmd.motor]]\n[[load_profile]]\nrmd = 1\nfile = "{}"',
}
PANEL = '\n[[panel]]\nsignals = ["rmd1.iq_amps"]\n'


def is_shown(text, but="\n"):
    """Whether a text has no character that controls a terminal, except those of `but`."""
    return not [c for c in text if c not in but and unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp")]


def is_clean(text):
    return is_shown(text) and "\nerror: fake" not in text


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("options", [(), ("--json",)])
def test_a_scenario_prints_and_draws_nothing_but_text(run, tmp_path, part, options):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(PARTS[part].format(IN_TOML) + PANEL)
    files = ("--csv", tmp_path / "run.csv", "--plot", tmp_path / "run.svg")
    done = run("sim", "run", scenario, *files, *options)
    assert is_clean(done.out) and is_clean(done.err), (done.out, done.err)
    assert "fake" in done.out + done.err or (tmp_path / "run.svg").exists()
    if (tmp_path / "run.svg").exists():
        assert is_clean((tmp_path / "run.csv").read_text())
        texts = [text.text or "" for text in ElementTree.parse(tmp_path / "run.svg").getroot().iter()]
        assert all(is_shown(text.strip()) for text in texts)


def test_a_picture_is_xml_whatever_the_title_is(run, tmp_path):
    scenario = tmp_path / "scenario.toml"
    title = r"<&>\"' \u0000 \u0008 \u001f \ufffe \uffff \U0001ffff ]]> ü 東京"
    scenario.write_text(f'title = "{title}"\nduration = 0.1\n[[rmd.motor]]{PANEL}')
    run("sim", "run", scenario, "--plot", tmp_path / "run.svg").ended(0)
    texts = [text.text or "" for text in ElementTree.parse(tmp_path / "run.svg").getroot().iter()]
    assert any("<&>\"'" in text and "]]> ü 東京" in text for text in texts), texts


@pytest.mark.parametrize(
    "words",
    [
        ("st", "-p", HOSTILE, "status"),
        ("rmd", "-p", f"slcan:{HOSTILE}", "status"),
        ("st", "-p", "sim:", "get", HOSTILE),
        ("sim", "--st", f"pty:{HOSTILE}", "--stdin"),
        ("sim", "--rom", f"/dev/null/{HOSTILE}", "--stdin"),
        ("sim", HOSTILE),
        ("sim", "run", HOSTILE),
        (HOSTILE,),
        ("st", f"--{HOSTILE}"),
    ],
    ids=lambda words: " ".join(words[:2]).split("\x1b")[0],
)
def test_errors_quote_words_as_text(motorlink, tmp_path, words):
    for more in ((), ("--json",)):
        done = subprocess.run(
            [motorlink, *words, *more], cwd=tmp_path, capture_output=True, text=True, timeout=60
        )
        assert done.returncode in (2, 3) and done.stderr
        assert is_shown(done.stdout) and is_shown(done.stderr), (done.stdout, done.stderr)


def test_a_terminal_gets_colours_and_no_other_sequence(motorlink, tmp_path):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(PARTS["why"].format(IN_TOML))
    near, far = pty.openpty()
    shown = subprocess.Popen(
        [motorlink, "sim", "run", scenario], stdout=far, stderr=far, env={**os.environ, "TERM": "xterm"}
    )
    os.close(far)
    out = b""
    while True:
        try:
            chunk = os.read(near, 4096)
        except OSError:
            break
        if not chunk:
            break
        out += chunk
    os.close(near)
    assert shown.wait() == 1
    text = out.decode().replace("\r\n", "\n")
    for colour in ("\x1b[31m", "\x1b[1m", "\x1b[0m"):
        text = text.replace(colour, "")
    assert "the run was not as expected" in text and is_clean(text), text


def test_answers_of_a_simulator_are_text(motorlink, tmp_path):
    commands = [
        {"command": "state", "port": HOSTILE},
        {"command": HOSTILE},
        {"command": "fault", "motor": 1, "fault": HOSTILE},
    ]
    done = subprocess.run(
        [motorlink, "sim", "--rmd", f"slcan-pty:{tmp_path}/can0", "--stdin"],
        input="".join(json.dumps(command) + "\n" for command in commands) + HOSTILE + "\n",
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert is_shown(done.stdout) and is_shown(done.stderr)
    answers = [json.loads(line) for line in done.stdout.splitlines()[1:]]
    assert len(answers) == 5 and not any(answer["ok"] for answer in answers)


def test_the_name_of_a_board_is_text(run, tmp_path):
    def answer(received):
        if received[0] & 0x1F != GET_BOARD_INFO:
            return frame(ACK, bytes(4 if received[2] == FLAGS else 1))
        return frame(ACK, (b"544" + "\x1b[2J\u202e\u009b\r\nerror: fake".encode()).ljust(32, b"\0"))

    with device(tmp_path / "drive", answer):
        for more in ((), ("--json",), ("--trace",)):
            done = run("st", "-p", tmp_path / "drive", "info", *more)
            assert "fake" in done.out + done.err
            assert is_clean(done.out) and is_clean(done.err), (done.out, done.err)
