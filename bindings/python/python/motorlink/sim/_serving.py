"""Ports on which a bench is served."""

from __future__ import annotations

import tempfile

from motorlink import _core
from motorlink._client import Closing


class Serving(Closing):
    """The ports of a served bench until the end of its ``with``, from :meth:`Bench.serve`."""

    #: The port of the ST drive for ``motorlink.st.open``; empty if it is not served.
    st: str
    #: The port of the RMD motors for ``motorlink.rmd.open``; empty if they are not served.
    rmd: str
    #: The ST drive's device or address, for other programs.
    st_path: str
    #: The RMD motors' device, address or CAN interface, for other programs.
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
        """Closes the ports. A second call does nothing."""
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
    """The name that opens a served port, and its path. ``line``: the scheme on a serial line."""
    if served is None:
        return "", ""
    port, path = served
    kind, _, name = port.partition(":")
    if kind == "tcp-listen":
        return f"{line}tcp:{path}", path
    return (port if kind == "socketcan" else line + name), path
