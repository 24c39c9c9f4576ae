"""Configurations and scenarios: TOML text, or the path of a file."""

from __future__ import annotations

import os
import re
from typing import Any, Union

Source = Union[str, "os.PathLike[str]"]


def is_path(source: Any) -> bool:
    """Whether a configuration or scenario is the path of a file, not the text itself."""
    is_text = isinstance(source, str) and (not source or re.search(r"[=\[\n]", source))
    return isinstance(source, (str, os.PathLike)) and not is_text


def text_or_path(source: Source) -> tuple[str, str | None]:
    """TOML text, or the path of a file."""
    return ("", os.fspath(source)) if is_path(source) else (str(source), None)
