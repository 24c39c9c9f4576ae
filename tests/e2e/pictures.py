"""Draws screens of the program as pictures for the documents: `pictures.py FOLDER`, which `make pictures`
runs. test_pictures.py compares them with the program."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.sax.saxutils import escape

import pyte

from program import Running, Sim, environment, eventually
from terminal import Terminal

COLUMNS = 80
#: Measures in pixels.
FONT, COLUMN, LINE, MARGIN = 14, 8.43, 19, 18
#: Colours, as crates/cli/src/palette.rs has them.
TEXT, BACKGROUND, BORDER, RUNNING, FAULT = "#24292f", "#ffffff", "#e4e7eb", "#13803f", "#c43e00"
#: Those of a terminal; any other marks a fault.
INKS = {"default": TEXT, "green": RUNNING}
FONTS = "ui-monospace, SFMono-Regular, Menlo, Consolas, 'DejaVu Sans Mono', monospace"


def draw(screen, title):
    """A screen as SVG, up to its last line with text."""
    last = max(number for number, line in enumerate(screen.display) if line.strip())
    width, height = round(2 * MARGIN + COLUMNS * COLUMN), 2 * MARGIN + LINE * (last + 1)
    svg = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" '
        f'font-family="{FONTS}" font-size="{FONT}">',
        f"<title>{escape(title)}</title>",
        f'<rect x="0.5" y="0.5" width="{width - 1}" height="{height - 1}" rx="8" fill="{BACKGROUND}" stroke="{BORDER}"/>',
    ]
    for number in range(last + 1):
        for column, text, (is_bold, is_reverse, colour) in runs(screen.buffer[number]):
            x, y, length = MARGIN + column * COLUMN, MARGIN + LINE * number, len(text) * COLUMN
            ink = INKS.get(colour, FAULT)
            if is_reverse:
                svg.append(f'<rect x="{x:.1f}" y="{y}" width="{length:.1f}" height="{LINE}" fill="{ink}"/>')
                ink = BACKGROUND
            if text.strip():
                weight = ' font-weight="bold"' if is_bold else ""
                svg.append(
                    f'<text x="{x:.1f}" y="{y + LINE - 5}" textLength="{length:.1f}" fill="{ink}"{weight} '
                    f'xml:space="preserve">{escape(text)}</text>'
                )
    return "\n".join([*svg, "</svg>", ""])


def runs(line):
    """The runs of equal style of a line: column, text, style. Spaces at the end of a line have no style."""
    found = []
    for column in range(COLUMNS):
        cell = line[column]
        style = (cell.bold, cell.reverse, cell.fg)
        if found and found[-1][2] == style:
            found[-1][1].append(cell.data)
        else:
            found.append((column, [cell.data], style))
    for column, cells, style in found:
        text = "".join(cells)
        yield column, text if style[1] else text.rstrip(), style


def shell(folder, motorlink, *commands):
    """A screen with commands and their output."""
    screen, stream = paper()
    for command in commands:
        stream.feed(prompt(command) + output(folder, motorlink, command))
    return screen


def paper():
    """An empty screen and the stream of its text."""
    screen = pyte.Screen(COLUMNS, 60)
    screen.set_mode(pyte.modes.LNM)
    return screen, pyte.Stream(screen)


def prompt(command):
    return f"\x1b[1m$ {command}\x1b[0m\n"


def output(folder, motorlink, command):
    """What a command prints."""
    path = {"PATH": f"{Path(motorlink).parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder, env=environment(path), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60,
    )
    return done.stdout


def demo(folder, motorlink, _):
    """The demo's screen during the fault."""
    terminal = Terminal([motorlink, "demo"], COLUMNS, 40, folder, NO_COLOR=None, TMPDIR="/tmp")
    try:
        assert terminal.wait(120) == 0
        drawn = terminal.raw.decode()
    finally:
        terminal.end()
    during = re.search(r".*waits for standstill.*?RMD 4[^\n]*", drawn, re.DOTALL)
    screen, stream = paper()
    stream.feed(prompt("motorlink demo") + during[0])
    return screen


def watch(folder, motorlink, drives):
    """Six motors: one gets faster, one turns, one is too hot."""
    run = lambda *words: subprocess.run(
        [motorlink, *words], cwd=folder, env=environment(), check=True, capture_output=True, timeout=60
    )
    run("rmd", "-p", "slcan:./can0", "--timeout", "1s", "--id", "2", "speed", "360")
    drives.do("temperature", port=f"slcan-pty:{folder}/can0", motor=4, celsius=120)
    run("st", "-p", "./st0", "start", "--ramp", "1500", "5s")
    words = ["watch", "-p", "./st0", "-p", "slcan:./can0", "--timeout", "1s", "--rate", "25"]
    terminal = Terminal([motorlink, *words], COLUMNS, 14, folder, NO_COLOR=None)
    texts = ("6 motors", "RUN", " 1500 rpm", "turning", "ERROR", "over temperature protection", "q quit")

    def complete():
        screen = terminal.frozen()
        rows = [line for line in screen.display if "/25.0 " in line]
        # The last column is the end of the trend.
        is_full = len(rows) == 6 and all(row[-1] != " " for row in rows)
        return screen if is_full and all(text in "\n".join(screen.display) for text in texts) else None

    try:
        return eventually(complete, "rates, trends and 1500 rpm", 60)
    finally:
        terminal.end()


def dump(folder, motorlink, _):
    """Settings into a file, a change, the difference, and back."""
    st = "motorlink st -p ./st0"
    return shell(
        folder, motorlink,
        f"{st} dump motor1.toml",
        "sed -n 9,13p motor1.toml",
        f"{st} set SPEED_KP 400",
        f"{st} diff motor1.toml",
        f"{st} restore motor1.toml",
    )


def share(folder, motorlink, _):
    """A share in the background with its log, and two programs on its lines."""
    serve = "motorlink share -p ./st0 -p slcan:./can0 --at unix:./share"
    running = Running([motorlink, *serve.split()[1:]], folder=folder)
    screen, stream = paper()
    try:
        stream.feed(prompt(f"{serve} &") + running.line(0) + "\n")
        told = 1
        for command in (
            "motorlink st -p share:./share/st0 set SPEED_KP 300",
            "motorlink rmd -p share:./share/rmd0 --id 2 stop",
        ):
            stream.feed(prompt(command) + output(folder, motorlink, command))
            has_left = lambda: any(line.endswith(" left") for line in running.out[told:])
            running.until(has_left, "the end of the log")
            stream.feed("".join(f"{line}\n" for line in running.out[told:]))
            told = len(running.out)
    finally:
        running.end()
    return screen


START = "motorlink st -p ./st0 start --ramp 1500 3s"
STOP = "motorlink st -p ./st0 stop"


def record(folder, motorlink, _):
    """A motor that gets faster is recorded."""
    return shell(
        folder, motorlink,
        START,
        "motorlink record -p ./st0 -m 1 -o run.mcap --duration 4s",
        STOP,
        "motorlink info run.mcap",
    )


def decode(folder, motorlink, _):
    """A short log of a bus, with a frame that is too short. Bit 3 of `errors` is an over temperature."""
    Path(folder, "can0.log").write_text(
        "(1.000000) can0 142#A200000010270000 T\n"
        "(1.000310) can0 142#A219640064000000 R\n"
        "(1.010000) can0 143#9A00000000000000 T\n"
        "(1.010290) can0 143#9A32000501000008 R\n"
        "(1.020000) can0 142#8100000000 R\n"
    )
    words = "motorlink decode rmd can0.log"
    terminal = Terminal([motorlink, *words.split()[1:]], COLUMNS, 20, folder)
    try:
        assert terminal.wait(60) == 0
        lines = [line.rstrip() for line in terminal.screen.display]
    finally:
        terminal.end()
    screen, stream = paper()
    stream.feed(prompt(words) + "\n".join(lines))
    return screen


def plot(folder, motorlink, _):
    """What the shell records, as `motorlink plot` draws it: an SVG."""
    commands = (START, "motorlink record -p ./st0 -m 1 -o run.mcap --duration 4s", STOP)
    for command in (*commands, "motorlink plot run.mcap --signals 'SPEED_*,TORQUE_MEAS,STATUS' --title 'run.mcap' -o run.svg"):
        output(folder, motorlink, command)
    return Path(folder, "run.svg").read_text(encoding="utf8")


#: Each picture: how its screen comes about, and its title, for screen readers.
PICTURES = {
    "demo": (demo, "motorlink demo: a table of two ST and four RMD motors; ST motor 1 has a fault, over-current"),
    "watch": (watch, "motorlink watch: a row for each of six motors with state, speed, current, temperature, supply and rate; one motor is too hot"),
    "share": (share, "motorlink share holds two ports; motorlink st and motorlink rmd use its lines; its log lists their requests"),
    "record": (record, "motorlink record writes a starting motor into run.mcap; motorlink info lists drives, topics, signals and rates"),
    "recording": (plot, "plot of a recording: speed, torque current and state of a motor that starts and follows a ramp to 1500 rpm"),
    "decode": (decode, "motorlink decode rmd prints the frames of a candump log with direction, motor, command and values; the last one is too short"),
    "dump": (dump, "motorlink st dump writes settings into a file, diff shows a changed gain, restore writes the old value"),
}


def picture(name, motorlink):
    """The SVG of a picture, on new simulated drives."""
    scene, title = PICTURES[name]
    with tempfile.TemporaryDirectory() as folder:
        drives = Sim([motorlink, "sim", "--stdin", "--json", "--st", f"pty:{folder}/st0", "--rmd", f"slcan-pty:{folder}/can0"], 2)
        try:
            found = scene(folder, motorlink, drives)
            return found if isinstance(found, str) else draw(found, title)
        finally:
            drives.end()


if __name__ == "__main__":
    for name in PICTURES:
        Path(sys.argv[1], f"{name}.svg").write_text(picture(name, os.environ["MOTORLINK_BIN"]), encoding="utf8")
