"""The package as a whole: the examples in its texts, and that there are texts."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from types import ModuleType

import pytest

import motorlink


def modules() -> list[str]:
    """Every module of the package, but for the one that runs when it is imported."""
    found = pkgutil.walk_packages(motorlink.__path__, "motorlink.")
    names = [module.name for module in found if not module.name.endswith("__main__")]
    return ["motorlink", *names]


@pytest.mark.parametrize("name", modules())
def test_the_examples_do_what_they_show(name: str) -> None:
    module = importlib.import_module(name)
    done = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert done.failed == 0


def public(module: ModuleType) -> list[tuple[str, object]]:
    """What a module offers."""
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
def test_everything_public_says_what_it_is(module: ModuleType) -> None:
    for name, thing in public(module):
        if not (inspect.isclass(thing) or inspect.isroutine(thing)):
            continue
        assert inspect.getdoc(thing), name
        if inspect.isclass(thing):
            for method, member in vars(thing).items():
                if not method.startswith("_") and callable(member):
                    assert inspect.getdoc(member), f"{name}.{method}"
