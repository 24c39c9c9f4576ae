"""The docstrings of the package, and the examples in them."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from types import ModuleType

import pytest

import motorlink


def modules() -> list[str]:
    """Every module of the package except `__main__`, which runs at import."""
    found = pkgutil.walk_packages(motorlink.__path__, "motorlink.")
    names = [module.name for module in found if not module.name.endswith("__main__")]
    return ["motorlink", *names]


@pytest.mark.parametrize("name", modules())
def test_the_examples_in_docstrings_run(name: str) -> None:
    module = importlib.import_module(name)
    done = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert done.failed == 0


def public(module: ModuleType) -> list[tuple[str, object]]:
    """The public names of a module."""
    return [(name, getattr(module, name)) for name in module.__all__]


@pytest.mark.parametrize(
    "module",
    [
        motorlink,
        motorlink.st,
        motorlink.rmd,
        motorlink.sim,
        motorlink.errors,
        motorlink.can,
        motorlink.aio.st,
        motorlink.aio.rmd,
    ],
)
def test_every_public_name_has_a_docstring(module: ModuleType) -> None:
    for name, thing in public(module):
        if not (inspect.isclass(thing) or inspect.isroutine(thing)):
            continue
        assert inspect.getdoc(thing), name
        if inspect.isclass(thing):
            for method, member in vars(thing).items():
                if not method.startswith("_") and callable(member):
                    assert inspect.getdoc(member), f"{name}.{method}"
