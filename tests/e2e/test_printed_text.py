"""Control characters in texts from outside never reach a terminal, a picture or a table."""

import json
import subprocess
import unicodedata
from xml.etree import ElementTree

import pytest

# Clears a screen (with two kinds of CSI), sets a title, reverses text, fakes a line.
HOSTILE = "\x1b[2J\x9b2J\x1b]0;title\x07\u202e\u2066\r\nerror: fake"
# The same in a string of TOML.
IN_TOML = json.dumps(HOSTILE)[1:-1]

BEGIN = 'title = ""\nduration = 0.1\n'
PARTS = {
    "title": 'title = "{}"\nduration = 0.1\n[[rmd.motor]]',
    "label": BEGIN + '[[rmd.motor]]\n[[event]]\nat = 0\nrmd = 1\nsend = "off"\nlabel = "{}"',
    "panel": BEGIN + '[[rmd.motor]]\n[[panel]]\ntitle = "{}"\nsignals = ["rmd1.speed_dps"]',
    "why": BEGIN + '[[rmd.motor]]\n[[expect]]\nwhy = "{}"\nsignal = "rmd1.speed_dps"\nmin = 3',
    "is": BEGIN + '[[rmd.motor]]\n[[expect]]\nwhy = ""\nsignal = "rmd1.mode"\nis = "{}"',
    "key": BEGIN + '"{}" = 3\n[[rmd.motor]]',
    "file": BEGIN + '[[rmd.motor]]\n[[load_profile]]\nrmd = 1\nfile = "{}"',
}
PANEL = '\n[[panel]]\nsignals = ["rmd1.iq_amps"]\n'


def is_shown(text, but="\n"):
    """Whether a text has no character that controls a terminal, except those of `but`."""
    return not [c for c in text if c not in but and unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp")]


def is_clean(text):
    return is_shown(text) and "\nerror: fake" not in text


@pytest.mark.parametrize("part", PARTS)
def test_a_scenario_prints_and_draws_nothing_but_text(run, tmp_path, part):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(PARTS[part].format(IN_TOML) + PANEL)
    files = ("--csv", tmp_path / "run.csv", "--plot", tmp_path / "run.svg")
    done = run("sim", "run", scenario, *files, *(("--json",) if part == "why" else ()))
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
        ("st", "-p", "sim:", "get", HOSTILE),
        ("sim", "--rom", f"/dev/null/{HOSTILE}", "--stdin"),
        ("sim", "run", HOSTILE),
        (HOSTILE,),
        ("st", f"--{HOSTILE}", "--json"),
    ],
    ids=lambda words: " ".join(words[:2]).split("\x1b")[0],
)
def test_errors_quote_words_as_text(run, words):
    done = run(*words)
    assert done.code in (2, 3) and done.err
    assert is_shown(done.out) and is_shown(done.err), (done.out, done.err)


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
