"""Benches whose drives are served on ports: real time, names of ports, errors."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motorlink
from motorlink import sim


def test_drives_served_on_ptys_run_in_real_time(tmp_path: Path) -> None:
    bench = sim.Bench()
    bench.run(10.0)
    ports = {"st": f"pty:{tmp_path}/st0", "rmd": f"slcan-pty:{tmp_path}/can0"}
    with bench.serve(**ports) as serving:
        assert (serving.st, serving.rmd) == (f"{tmp_path}/st0", f"slcan:{tmp_path}/can0")
        assert serving.st_path.startswith("/dev/pts/")
        with pytest.raises(motorlink.PortError, match="served already"):
            bench.serve()
        with motorlink.st.open(serving.st) as st, motorlink.rmd.open(serving.rmd, timeout=5) as rmd:
            assert st.motor(1).status() == "IDLE"
            bench.push("rmd1", 0.5)
            while rmd.motor(1).motion_status().speed_dps < 180:
                assert bench.now < 70
            before = bench.now
            with bench.recording(["rmd1.angle_degrees"], every=0.01) as recording:
                bench.run(0.05)
            assert bench.now >= before + 0.05
            assert len(recording.data) >= 6
            assert np.all(np.diff(recording.data["rmd1.angle_degrees"]) > 0)
    assert not (tmp_path / "st0").exists()
    stands = bench.now
    assert stands > 10
    time.sleep(0.005)
    assert bench.now == stands


def test_served_without_a_name_or_over_tcp() -> None:
    with sim.Bench().serve() as serving, motorlink.rmd.open(serving.rmd, timeout=5) as bus:
        assert len(bus.scan(range(1, 5))) == 4
        folder = Path(serving.st).parent
    assert not folder.exists()
    with sim.Bench().serve(st="tcp-listen:127.0.0.1:0") as serving:
        assert serving.rmd == ""
        with motorlink.st.open(serving.st) as st:
            assert st.motor(1).status() == "IDLE"
    serving.close()


def test_a_port_that_cannot_be_served_leaves_virtual_time(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    bench = sim.Bench()
    with pytest.raises(motorlink.PortError, match="not a link to a pty"):
        bench.serve(st=f"pty:{tmp_path}/file")
    bench.run(1.0)
    assert bench.now == 1.0


@pytest.mark.parametrize(
    ("ports", "kind", "message"),
    [
        ({"rmd": "socketcan:nowhere0"}, motorlink.PortError, "no CAN interface `nowhere0`"),
        ({"st": "carrier-pigeon"}, motorlink.InvalidValueError, "served ports are pty:PATH"),
    ],
)
def test_a_port_that_cannot_be_created_says_which_and_why(
    ports: Any, kind: type[Exception], message: str
) -> None:
    with sim.Bench() as bench, pytest.raises(kind, match=message):
        bench.serve(**ports)
