"""Ports on which a bench is served."""

from __future__ import annotations

import tempfile

from motorlink import _core
from motorlink._client import Closing


class Serving(Closing):
    """Ports on which a bench is served until the end of its ``with``, from :meth:`Bench.serve`."""

    #: The ST drive for ``motorlink.st.open``; on a pty also for other programs. Empty: not served.
    st: str
    #: The RMD motors for ``motorlink.rmd.open``. Empty: not served.
    rmd: str
    #: What other programs open: device, address or CAN interface.
    st_path: str
    rmd_path: str

    def __init__(self, core: _core.SimBench, st: str | None, rmd: str | None):
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if st is None and rmd is None:
            self._folder = tempfile.TemporaryDirectory(prefix="motorlink-")
            st = f"pty:{self._folder.name}/st0"
            rmd = f"slcan-pty:{self._folder.name}/can0"
        try:
            self._core = core.serve(st=st, rmd=rmd)
        except BaseException:
            self._remove_folder()
            raise
        self.st, self.st_path = _opened(self._core.st, "")
        self.rmd, self.rmd_path = _opened(self._core.rmd, "slcan:")

    def close(self) -> None:
        """Closes the ports. Again is no error."""
        try:
            self._core.end()
        finally:
            self._remove_folder()

    def _remove_folder(self) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def _end(self, *, in_flight: bool) -> None:
        self.close()


def _opened(served: tuple[str, str] | None, line: str) -> tuple[str, str]:
    """The port that reaches what is served, and its path; ``line``: how it speaks on a serial line."""
    if served is None:
        return "", ""
    port, path = served
    kind, _, name = port.partition(":")
    if kind == "tcp-listen":
        return f"{line}tcp:{path}", path
    return (port if kind == "socketcan" else line + name), path
