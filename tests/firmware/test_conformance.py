"""The conformance kit against the board: both protocols, the motors turning."""

import pytest


@pytest.mark.parametrize("protocol", ["st", "rmd"])
def test_the_kit_passes(board, run, protocol):
    port = {"st": board.st_port, "rmd": board.rmd_port}[protocol]
    words = ("--spin", "--readings", "strict", "--json")
    kit = run("conformance", protocol, "-p", port, *words, within=1800)
    result = kit.ended(0).json
    assert result["not_run"] == 0 and result["passed"] > 100, result
