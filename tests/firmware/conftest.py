"""Boards in QEMU, in Rust and in C. `make firmware-test` builds them and does all of it.

MOTORLINK_FIRMWARE is the folder with board-rust.elf and board-c.elf. A test gets a board that has
just been switched on, and the program and the hosts of tests/e2e.
"""

import importlib.util
import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

END_TO_END = Path(__file__).parents[1] / "e2e"
sys.path.insert(0, str(END_TO_END))
pytest.register_assert_rewrite("test_rmd_can", "test_st_bytes")

import stmcp  # noqa: E402
from program import eventually  # noqa: E402

_spec = importlib.util.spec_from_file_location("end_to_end", END_TO_END / "conftest.py")
_end_to_end = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_end_to_end)
motorlink, run, start = _end_to_end.motorlink, _end_to_end.run, _end_to_end.start

GET_STATUS = stmcp.frame(stmcp.header(stmcp.GET_REG, 1), [0x02])


def elf(language):
    path = Path(os.environ["MOTORLINK_FIRMWARE"]) / f"board-{language}.elf"
    assert path.exists(), f"{path} is not built: `firmware/build.sh`"
    return path


def first():
    """The protocols' deadlines are real time: where it is allowed, a board goes before what else this
    machine does. Kernels that group by session look at the group's niceness alone."""
    os.setsid()
    try:
        os.nice(-15)
        Path("/proc/self/autogroup").write_text("-15")
    except OSError:
        pass


class Board:
    """A board in QEMU with both UARTs on TCP ports of this machine, which QEMU chooses."""

    def __init__(self, language):
        self.language = language
        uarts = []
        for name in ("st", "rmd"):
            # Bytes go out one by one: without nodelay each waits for the last one's acknowledge.
            options = "host=127.0.0.1,port=0,server=on,wait=off,nodelay=on"
            uarts += ["-chardev", f"socket,id={name},{options}", "-serial", f"chardev:{name}"]
        self.process = subprocess.Popen(
            ["qemu-system-arm", "-M", "netduinoplus2", "-kernel", str(elf(language))]
            + ["-display", "none", "-monitor", "none", "-qmp", "stdio", *uarts],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            preexec_fn=first,
        )
        try:
            self._read()
            self._do("qmp_capabilities")
            found = {device["label"]: device["filename"] for device in self._do("query-chardev")}
            self.st, self.rmd = (
                int(re.search(r"127\.0\.0\.1:(\d+)", found[name])[1]) for name in ("st", "rmd")
            )
            self._await(self.st, GET_STATUS)
            self._await(self.rmd, b"\r")
        except BaseException:
            self.end()
            raise

    def _read(self):
        line = self.process.stdout.readline()
        assert line, f"QEMU ended with {self.process.wait()}"
        return json.loads(line)

    def _do(self, command):
        self.process.stdin.write(json.dumps({"execute": command}) + "\n")
        self.process.stdin.flush()
        while "return" not in (answer := self._read()):
            assert "error" not in answer, answer
        return answer["return"]

    def _await(self, port, question):
        """Asks until there are answers, and takes them all."""
        with self.connect(port) as line:
            line.settimeout(0.1)
            answers = b""

            def answer():
                nonlocal answers
                try:
                    answers += line.recv(64)
                    return True
                except TimeoutError:
                    return False

            def asked():
                line.sendall(question)
                return answer()

            eventually(asked, f"an answer on port {port}")
            while answer():
                pass

    def connect(self, port, timeout=5):
        line = socket.create_connection(("127.0.0.1", port), timeout)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return line

    @property
    def st_port(self):
        """What -p takes for the ST drive."""
        return f"tcp:127.0.0.1:{self.st}"

    @property
    def rmd_port(self):
        """What -p takes for the RMD motors."""
        return f"slcan:tcp:127.0.0.1:{self.rmd}"

    def end(self):
        self.process.terminate()
        self.process.communicate(timeout=10)


@pytest.fixture(params=["rust", "c"])
def board(request):
    """A board that has just been switched on."""
    board = Board(request.param)
    yield board
    board.end()


@pytest.fixture
def st(run, board):
    """Runs `motorlink st` on the board."""
    return lambda *words, **options: run("st", "-p", board.st_port, *words, **options)


@pytest.fixture
def rmd(run, board):
    """Runs `motorlink rmd` on the board, which may take its time on a machine under load."""
    return lambda *words: run("rmd", "-p", board.rmd_port, "--timeout", 500, *words)
