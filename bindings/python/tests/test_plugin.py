"""The pytest plugin as the tests of a user see it."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest_plugins = ["pytester"]

ARM = """
    import time
    import motorlink

    class Arm:
        "A user's code. It opens a port and sleeps, and has nothing of the simulation."

        def __init__(self, port):
            self.bus = motorlink.rmd.open(port, timeout=1)

        def lift(self):
            motor = self.bus.motor(1)
            motor.set_position(90, max_speed_dps=720)
            deadline = time.monotonic() + 2
            while abs(motor.multi_turn_angle() - 90) > 1:
                if time.monotonic() > deadline:
                    raise RuntimeError("the arm is stuck")
                time.sleep(0.01)
"""


def test_a_users_code_is_tested_on_virtual_time(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(arm=ARM)
    pytester.makepyfile(
        """
        import pytest
        from arm import Arm

        def test_it_lifts(motorlink_bench, motorlink_time):
            Arm(motorlink_bench).lift()
            assert 0.1 < motorlink_bench.now < 2
            assert abs(motorlink_bench.truth("rmd1")["angle_degrees"] - 90) < 1

        def test_it_notices_that_it_is_stuck(motorlink_bench, motorlink_time):
            motorlink_bench.lock_rotor("rmd1")
            with pytest.raises(RuntimeError, match="stuck"):
                Arm(motorlink_bench).lift()

        def test_each_test_has_a_bench_of_its_own(motorlink_bench):
            assert motorlink_bench.now == 0
            assert len(motorlink_bench.motors) == 6

        def test_programs_find_it_on_ports(motorlink_bench, motorlink_ports, tmp_path):
            assert motorlink_ports.st == f"{tmp_path}/st0"
            Arm(motorlink_ports.rmd).lift()
            assert abs(motorlink_bench.truth("rmd1")["angle_degrees"] - 90) < 2
        """
    )
    pytester.runpytest("--strict-markers").assert_outcomes(passed=4)


def test_a_marker_configures_the_bench(pytester: pytest.Pytester) -> None:
    pytester.mkdir("benches").joinpath("one.toml").write_text("[[rmd.motor]]\nid = 9")
    pytester.makeini("[pytest]\nmotorlink_config = benches/one.toml")
    pytester.makepyfile(
        """
        import motorlink
        import pytest

        def test_the_configuration_of_the_project(motorlink_bench):
            assert motorlink_bench.motors == ("st1", "st2", "rmd9")

        @pytest.mark.motorlink("[[st.motor]]")
        def test_text(motorlink_bench):
            assert motorlink_bench.motors == ("st1", "rmd1", "rmd2", "rmd3", "rmd4")

        @pytest.mark.motorlink({"rmd": {"motor": [{"id": 4}]}}, seed=7)
        def test_a_dict(motorlink_bench):
            assert motorlink_bench.motors == ("st1", "st2", "rmd4")

        @pytest.mark.motorlink("benches/one.toml", fault="drop=1")
        def test_a_file_and_faults(motorlink_bench):
            assert motorlink_bench.motors[-1] == "rmd9"
            with pytest.raises(motorlink.ReplyTimeoutError):
                motorlink_bench.rmd.motor(9).status()

        """
    )
    pytester.runpytest("--strict-markers").assert_outcomes(passed=4)


def test_a_bench_that_cannot_be_built_says_why(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nmotorlink_config = absent.toml")
    pytester.makepyfile(
        """
        import pytest

        def test_of_the_setting(motorlink_bench):
            pass

        @pytest.mark.motorlink(fault="explode=1")
        def test_of_a_fault(motorlink_bench, motorlink_time):
            pass

        @pytest.mark.motorlink(sed=7)
        def test_of_an_argument(motorlink_bench):
            pass
        """
    )
    outcome = pytester.runpytest("--strict-markers")
    outcome.assert_outcomes(errors=3)
    outcome.stdout.fnmatch_lines(
        [
            "the setting motorlink_config: cannot read*absent.toml*",
            "the marker motorlink: *explode*",
            "the marker motorlink: *unexpected keyword argument 'sed'",
        ]
    )
    assert "Traceback" not in outcome.stdout.str()
    assert "AttributeError" not in outcome.stdout.str()


def test_pytest_lists_the_marker(pytester: pytest.Pytester) -> None:
    pytester.runpytest("--markers").stdout.fnmatch_lines(["@pytest.mark.motorlink(config*"])


def test_other_tests_do_not_load_the_package(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import sys

        def test_nothing_is_loaded():
            assert "motorlink.pytest_plugin" in sys.modules
            assert "motorlink._core" not in sys.modules
            assert "numpy" not in sys.modules
        """
    )
    pytester.runpytest_subprocess().assert_outcomes(passed=1)
    code = "import motorlink._cli, sys; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
