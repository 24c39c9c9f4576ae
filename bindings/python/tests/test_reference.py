"""The public names of the package, and the reference in docs/PYTHON.md."""

from __future__ import annotations

import importlib
import re
from types import ModuleType

import pytest

import motorlink
from reference import MODULES, PAGE, page
from test_package import modules


def documented() -> dict[str, set[str]]:
    """The names in the reference, by module."""
    names: dict[str, set[str]] = {}
    reference = PAGE.read_text().split("\n## Reference\n")[1]
    for section in re.split(r"\n### ", reference)[1:]:
        module = section.split("\n")[0]
        headings = re.findall(r"^#### (?:\w+\.)*(\w+)$", section, re.M)
        lists = re.findall(r"^(?:Modules|Described elsewhere|Functions that)[^:]*:(.*?)\.$", section, re.M | re.S)
        names[module] = {*headings, *re.findall(r"`(\w+)`", " ".join(lists))}
    return names


def test_the_reference_is_up_to_date() -> None:
    assert PAGE.read_text() == page(), "docs/PYTHON.md is old: `make python-docs` updates it"


@pytest.mark.parametrize("module", MODULES, ids=lambda module: str(module.__name__))
def test_public_names_are_the_documented_names(module: ModuleType) -> None:
    assert set(dir(module)) == set(module.__all__) == documented()[module.__name__]
    assert len(set(module.__all__)) == len(module.__all__)


def test_every_public_module_lists_its_names() -> None:
    public = {name for name in modules() if "._" not in name}
    assert public == {module.__name__ for module in MODULES} | {"motorlink.pytest_plugin"}
    for name in public:
        assert importlib.import_module(name).__all__
