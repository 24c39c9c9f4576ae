"""Finds the code blocks of Markdown pages.

A block is fenced and names its language. A word after the language says how it is checked:

| fence | check |
|---|---|
| `sh` | each line runs, some for a shorter time (`QUICKER`), and ends with 0, or with N where it ends in `# exit N` |
| `sh skip=REASON` | not run; `REASON` is one of `SKIPS` |
| `python` | all blocks of a page run in order in one process, beside the guards, shares and nodes that its `sh` blocks start |
| `python pytest` | runs as a test file |
| `c`, `rust` | a program: it compiles without a warning and runs |
| `toml scenario`, `toml config` | `motorlink sim run` plays it, `motorlink sim` serves it |
| `json` | each line is valid by docs/json.schema.json |
| `json any` | each line is JSON |
| `LANGUAGE fragment`, `text` | not checked, except that a TOML fragment is TOML |
"""

import re
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
PAGES = sorted([*REPOSITORY.glob("*.md"), *REPOSITORY.glob("docs/*.md")])

#: Why lines of a shell are not run: they need root, compile or run for minutes, or have names that
#: the reader replaces.
SKIPS = {"root", "build", "long", "placeholder"}
#: The words that a fence may have after its language.
WORDS = {
    "sh": {"", *(f"skip={reason}" for reason in SKIPS)},
    "python": {"", "pytest", "fragment"},
    "c": {"", "fragment"},
    "rust": {"", "fragment"},
    "toml": {"scenario", "config", "fragment"},
    "json": {"", "any"},
    "cmake": {"fragment"},
    "text": {""},
}

FENCE = re.compile(r"^( *)```(.*)$")
LIST_ITEM = re.compile(r"^ *([-*]|\d+\.) ")


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    page: str
    line: int
    language: str
    word: str
    text: str

    def __str__(self):
        return f"{self.page}:{self.line}"


def read(path):
    """The blocks of a page, and the lines that are indented as code without a fence."""
    page = str(path.relative_to(REPOSITORY))
    blocks, indented = [], []
    fence, in_list, before = None, False, ""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        match = FENCE.match(line)
        if fence:
            if match and not match[2]:
                indent, start, info, lines = fence
                language, _, word = info.partition(" ")
                text = "".join(f"{line.removeprefix(indent)}\n" for line in lines)
                blocks.append(Block(page, start, language, word, text))
                fence = None
            else:
                fence[3].append(line)
        elif match:
            fence = (match[1], number, match[2].strip(), [])
        elif LIST_ITEM.match(line):
            in_list = True
        elif line and not line.startswith(" "):
            in_list = False
        elif line.startswith("    ") and not before and not in_list:
            indented.append(number)
        before = line.strip()
    assert not fence, f"{page}:{fence[1]}: the fence is not closed"
    return blocks, indented


def of(language, *words):
    """The blocks of all pages in a language, with one of these words after it."""
    return [
        block
        for page in PAGES
        for block in read(page)[0]
        if block.language == language and block.word in words
    ]


def by_page(language, *words):
    """The same, a list a page."""
    pages = {}
    for block in of(language, *words):
        pages.setdefault(block.page, []).append(block)
    return pages
