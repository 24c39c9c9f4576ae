"""The text of the pages outside their code blocks."""

import re
from collections import Counter

from blocks import FENCE, PAGES, REPOSITORY

WIDTH = 100
#: Pages that a program writes.
GENERATED = {"SIZES.md"}
GENERATED_PART = re.compile(r"<!-- begin of what.*?<!-- end of what", re.DOTALL)
NOTES = REPOSITORY / "docs/SPEC-NOTES.md"
ROW = re.compile(r"^\| ([SR]\d+) \|.* \| (.*) \|$", re.MULTILINE)
TEST = re.compile(r"`([a-z0-9]+(?:_[a-z0-9]+){2,})`")


def prose(text):
    """The lines that can be wrapped, with their numbers: no code, tables, images or generated parts."""
    text = GENERATED_PART.sub(lambda part: "\n" * part[0].count("\n"), text)
    code = False
    for number, line in enumerate(text.splitlines(), 1):
        if FENCE.match(line):
            code = not code
        elif not code and not line.lstrip().startswith(("|", "![")):
            yield number, line


def test_lines_have_at_most_100_characters():
    pages = (page for page in PAGES if page.name not in GENERATED)
    long = [
        f"{page.name}:{number}"
        for page in pages
        for number, line in prose(page.read_text())
        if len(line) > WIDTH
    ]
    assert long == []


def test_each_row_of_the_notes_exists_once():
    rows = Counter(row[1] for row in ROW.finditer(NOTES.read_text()))
    assert rows and [row for row, count in rows.items() if count > 1] == []


def test_the_tests_that_the_notes_name_exist():
    files = (
        file for folder in ("crates", "reliability") for file in (REPOSITORY / folder).rglob("*.rs")
    )
    names = {name for file in files for name in re.findall(r"\w+", file.read_text())}
    named = {name for row in ROW.finditer(NOTES.read_text()) for name in TEST.findall(row[2])}
    assert named and sorted(named - names) == []
