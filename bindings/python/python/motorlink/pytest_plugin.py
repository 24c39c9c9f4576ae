"""Fixtures for pytest that test a program against simulated drives. Installed with the package.

::

    import motorlink
    import pytest
    from my_robot import Arm                       # opens its drive with motorlink.st.open(port)

    @pytest.mark.motorlink("[[st.motor]]\\npreset = 'servo'")
    def test_the_arm_stops_when_it_jams(motorlink_bench):
        arm = Arm(motorlink_bench)                 # a bench is a port
        arm.lift()
        motorlink_bench.lock_rotor("st1")
        motorlink_bench.run(2.0)                   # s of virtual time
        assert motorlink_bench.truth("st1")["status"] == "IDLE"

``motorlink_bench``
    A new :class:`motorlink.sim.Bench` on virtual time.
``motorlink_time``
    During the test ``time.sleep`` and the clocks of ``time`` use the time of that bench
    (:meth:`~motorlink.sim.Bench.patch_time`), for programs that sleep.
``motorlink_ports``
    That bench on ptys in ``tmp_path``, on real time, for programs that open ports by name:
    :class:`motorlink.sim.Serving`, ``ports.st`` and ``ports.rmd``.

The marker ``motorlink(config, *, seed, fault)`` has the arguments of the bench. The path of a file is
relative to the test file. Without the marker the bench is that of the setting ``motorlink_config`` in
pytest's configuration, relative to that file. Without this setting it is the default bench.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

__all__ = ["motorlink_bench", "motorlink_ports", "motorlink_time"]

# Imported by the first fixture, because most runs of pytest need none.
if TYPE_CHECKING:
    from motorlink.sim import Bench, Serving


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds ``motorlink_config`` to pytest's configuration."""
    about = "configuration of motorlink_bench: a TOML file, or its text"
    parser.addini("motorlink_config", about, default="")


def pytest_configure(config: pytest.Config) -> None:
    """Registers the marker."""
    about = "motorlink(config, *, seed, fault): the arguments of the test's motorlink_bench"
    config.addinivalue_line("markers", about)


@pytest.fixture
def motorlink_bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Simulated drives on virtual time, new for each test."""
    from motorlink.errors import MotorlinkError
    from motorlink.sim import Bench

    marker = request.node.get_closest_marker("motorlink")
    try:
        if marker is None:
            inifile = request.config.inipath
            folder = request.config.rootpath if inifile is None else inifile.parent
            bench = Bench(_beside(folder, request.config.getini("motorlink_config")))
        else:
            config, *others = marker.args or (None,)
            bench = Bench(_beside(request.path.parent, config), *others, **marker.kwargs)
    except (MotorlinkError, TypeError) as error:
        source = "the setting motorlink_config" if marker is None else "the marker motorlink"
        pytest.fail(f"{source}: {error}", pytrace=False)
    with bench:
        yield bench


@pytest.fixture
def motorlink_time(motorlink_bench: Bench) -> Iterator[None]:
    """``time.sleep`` and the clocks of ``time`` use the time of ``motorlink_bench``."""
    with motorlink_bench.patch_time():
        yield


@pytest.fixture
def motorlink_ports(motorlink_bench: Bench, tmp_path: Path) -> Iterator[Serving]:
    """``motorlink_bench`` on ptys, on real time."""
    names = {"st": f"pty:{tmp_path}/st0", "rmd": f"slcan-pty:{tmp_path}/can0"}
    with motorlink_bench.serve(**names) as ports:
        yield ports


def _beside(folder: Path, config: Any) -> Any:
    """A path relative to ``folder``; anything else unchanged."""
    from motorlink.sim._source import is_path

    return folder / config if is_path(config) else config
