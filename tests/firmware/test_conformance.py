"""The conformance kit against the boards: both protocols, the motors turning.

Each protocol in one language: the kit takes minutes here. Drives in both languages pass it on this computer,
and the example in C passes the one of ST on its board, too.
"""

import pytest


pytestmark = pytest.mark.long


@pytest.mark.parametrize(("board", "protocol"), [("rust", "st"), ("c", "rmd")], indirect=["board"])
def test_the_kit_passes(board, run, protocol):
    port = {"st": board.st_port, "rmd": board.rmd_port}[protocol]
    words = ("--spin", "--readings", "strict", "--json")
    kit = run("conformance", protocol, "-p", port, *words, within=1800)
    result = kit.ended(0).json
    assert result["not_run"] == 0 and result["passed"] > 100, result
