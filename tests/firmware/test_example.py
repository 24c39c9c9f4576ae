"""The bare-metal example of the installed C library, as its Makefile builds it."""

import pytest
from conftest import Board


@pytest.fixture(params=["example"])
def board(request):
    """The example with a time that a host steps."""
    board = Board(request.param)
    yield board
    board.end()


@pytest.fixture
def example():
    """The example in real time."""
    board = Board("C", program="real-time")
    yield board
    board.end()


# The motor of the RMD drive has no inertia: cases that turn it would fail.
@pytest.mark.parametrize(("protocol", "words"), [("st", ["--spin"]), ("rmd", [])])
def test_the_kit_passes(board, run, protocol, words):
    port = {"st": board.st_port, "rmd": board.rmd_port}[protocol]
    kit = run("conformance", protocol, "-p", port, *words, "--readings", "strict", "--json", within=600)
    result = kit.ended(0).json
    assert result["failed"] == 0 and result["passed"] > 50, result["passed"]


def test_both_protocols_answer_in_real_time(example, run):
    port = f"tcp:127.0.0.1:{example.st}"
    assert "Fan in C Ver.1.2.0" in run("st", "-p", port, "info").ended(0).out
    port = f"slcan:tcp:127.0.0.1:{example.rmd}"
    assert "multi turn angle" in run("rmd", "-p", port, "-i", 1, "angle").ended(0).out
