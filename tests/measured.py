"""A plugin of pytest for the parts of `make test`: the processor time of each test, with the processes that it ended,
goes to the JUnit file, and tests marked `long` run only with the variable LONG (`make verify`)."""

import os
import resource

import pytest


def processor():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(it.ru_utime + it.ru_stime for it in used)


def pytest_configure(config):
    config.addinivalue_line("markers", "long: takes long, runs with LONG=1 and in `make verify`")


def pytest_collection_modifyitems(config, items):
    if not os.environ.get("LONG"):
        left_out = [it for it in items if it.get_closest_marker("long")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [it for it in items if it not in left_out]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    item.before = processor()
    return (yield)


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item):
    item.user_properties.append(("processor", f"{processor() - item.before:.3f}"))
