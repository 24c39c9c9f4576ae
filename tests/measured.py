"""A plugin of pytest: the processor time of each test, with the processes that it ended, in the JUnit file."""

import resource

import pytest


def processor():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(it.ru_utime + it.ru_stime for it in used)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    item.before = processor()
    return (yield)


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item):
    item.user_properties.append(("processor", f"{processor() - item.before:.3f}"))
