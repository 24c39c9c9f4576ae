"""Configurations and scenarios: TOML text, or the path of a file."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from typing import Any, Union

from motorlink.errors import InvalidValueError

Source = Union[str, "os.PathLike[str]"]


def is_path(source: Any) -> bool:
    """Whether a configuration or scenario is the path of a file."""
    is_text = isinstance(source, str) and (not source or re.search(r"[=\[\n]", source))
    return isinstance(source, (str, os.PathLike)) and not is_text


def text_or_path(source: Source) -> tuple[str, str | None]:
    """TOML text, or the path of a file."""
    if is_path(source):
        return "", os.fspath(source)
    if isinstance(source, str):
        return source, None
    raise TypeError(f"give TOML text or the path of a file, not {source!r}")


def as_json(members: Mapping[str, Any], what: str) -> str:
    """A configuration or a command as JSON; ``what`` begins the error."""
    try:
        return json.dumps(dict(members), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{what}: {error} in {dict(members)}") from error
