"""The harness itself: what it finds on a page, and what it reports."""

import pytest

import blocks
from shell import lines

PAGE = """\
Text.

```sh
motorlink ports   # a comment
motorlink st get SPEED_MEAS \\
    --every 100ms
false  # exit 1
```

- An item

    with a paragraph, which is no code.

Text.

    code without a fence

  ```toml fragment
  a = 1
  ```
"""


@pytest.fixture
def page(monkeypatch, tmp_path):
    monkeypatch.setattr(blocks, "REPOSITORY", tmp_path)
    path = tmp_path / "page.md"
    path.write_text(PAGE)
    return path


def test_blocks_and_code_without_a_fence_are_found(page):
    found, indented = blocks.read(page)
    assert [(block.language, block.word, block.line) for block in found] == [
        ("sh", "", 3),
        ("toml", "fragment", 18),
    ]
    assert found[1].text == "a = 1\n"
    assert indented == [16]


def test_a_line_that_fails_is_an_error(shell):
    with pytest.raises(AssertionError, match="exit code 2, not 0: motorlink st get NOTHING -p sim:"):
        shell.run(*next(lines("motorlink st get NOTHING -p sim:")))
    with pytest.raises(AssertionError, match="exit code 0, not 1"):
        shell.run(*next(lines("true  # exit 1")))
    with pytest.raises(AssertionError, match="make no-such-target"):
        shell.run(*next(lines("make no-such-target")))
