"""The pictures of the documents show what the program prints. `make pictures` draws them."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from pictures import PICTURES, picture

FOLDER = Path(__file__).parents[2] / "docs"


def words(svg):
    """The text of a picture, line by line, without values that differ from run to run."""
    lines = {}
    for text in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"):
        lines.setdefault(int(text.get("y")), []).append((float(text.get("x")), text.text))
    joined = [" ".join(text for _, text in sorted(parts)) for _, parts in sorted(lines.items())]
    # A rate is called `only` if it is low, and one message has none. A start is seen in one of its states.
    # A folder of the demo has a name of its own.
    bars = re.compile("[▁▂▃▄▅▆▇█]+|, [0-9.]+ Hz$|only (?=[0-9])|(?<=starts: )[A-Z_]+|(?<=/tmp/motorlink-)[^/]+")
    numbers = re.compile(r"-?\d[\d.]*")
    return [" ".join(numbers.sub("0", bars.sub("", line)).split()) for line in joined]


def names(svg):
    """The names of a plot: signals and units."""
    texts = (text.text.strip() for text in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"))
    return {text for text in texts if re.search("[/(]", text)}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_shows_the_program_of_today(name, motorlink):
    drawn = (FOLDER / f"{name}.svg").read_text(encoding="utf8")
    compared = names if name == "recording" else words
    assert compared(drawn) == compared(picture(name, motorlink)), f"`make pictures` draws {name}.svg anew"
