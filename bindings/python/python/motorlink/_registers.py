"""The registers of a motor as a mapping."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator, Mapping
from typing import Protocol

from motorlink import _core
from motorlink._values import RegisterInfo
from motorlink.errors import RefusedError


class Registers(Mapping[str, float]):
    """The registers of one motor (table 3) as a mapping, by name.

    >>> import motorlink
    >>> client = motorlink.st.open("sim:")
    >>> registers = client.motor(1).registers
    >>> registers["SPEED_KP"] = 1200             # writes; so does registers.SPEED_KP = 1200
    >>> registers.SPEED_KP                       # reads
    1200
    >>> registers.info("BUS_VOLTAGE").unit
    'V'
    >>> client.close()

    Each access is one exchange with the drive. It raises as ``Motor.get`` and ``Motor.set`` do. IPython
    and Jupyter complete the names: ``registers.<TAB>``, ``registers["<TAB>``.
    """

    __slots__ = ("_motor",)

    _motor: BlockingMotor

    def __init__(self, motor: BlockingMotor):
        object.__setattr__(self, "_motor", motor)

    def __getitem__(self, name: str | int) -> float:
        return self._motor.get(name)

    def __setitem__(self, name: str | int, value: float | str) -> None:
        self._motor.set(name, value)

    def __getattr__(self, name: str) -> float:
        if name not in self._names():
            raise AttributeError(f"unknown register {name!r}: `list(registers)` lists the names")
        return self._motor.get(name)

    def __setattr__(self, name: str, value: float | str) -> None:
        if name not in self._names():
            raise AttributeError(f"unknown register {name!r}: `list(registers)` lists the names")
        self._motor.set(name, value)

    def __copy__(self) -> Registers:
        return Registers(self._motor)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __contains__(self, name: object) -> bool:
        return name in self._names()

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._names()]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self._names())

    def __repr__(self) -> str:
        return f"<{len(self)} registers of {self._motor!r}>"

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def info(self, name: str | int) -> RegisterInfo:
        """The register's unit, type, access and needs, from the table. Sends nothing.

        Raises ``UnknownRegisterError`` for an unknown name.
        """
        return RegisterNames(self._motor).info(name)

    def get_all(self) -> dict[str, float]:
        """Reads every register that the drive has. One exchange each."""
        values = {}
        for name in self:
            if not self.info(name).readable:
                continue
            try:
                values[name] = self[name]
            except RefusedError:
                continue
        return values

    def _names(self) -> dict[str, None]:
        return _names(self._motor.client.profile)


class HasRegisters(Protocol):
    """A motor of either API."""

    @property
    def client(self) -> HasProfile: ...
    @property
    def full_scale_amps(self) -> float | None: ...


class BlockingMotor(HasRegisters, Protocol):
    """A motor of the blocking API."""

    def get(self, register: str | int) -> float: ...
    def set(self, register: str | int, value: float | str) -> None: ...


class HasProfile(Protocol):
    """A client of either API."""

    @property
    def profile(self) -> str: ...


class RegisterNames(Collection[str]):
    """The names of a motor's registers, in the order of their numbers (table 3). Sends nothing.

    >>> import asyncio, motorlink
    >>> async def main() -> str:
    ...     async with motorlink.aio.st.open("sim:") as client:
    ...         return client.motor(1).registers.info("BUS_VOLTAGE").unit
    >>> asyncio.run(main())
    'V'
    """

    __slots__ = ("_motor",)

    def __init__(self, motor: HasRegisters):
        self._motor = motor

    def info(self, name: str | int) -> RegisterInfo:
        """The register's unit, type, access and needs, from the table.

        Raises ``UnknownRegisterError`` for an unknown name.
        """
        motor = self._motor
        return _core.st_register(name, motor.client.profile, motor.full_scale_amps)

    def __iter__(self) -> Iterator[str]:
        return iter(_names(self._motor.client.profile))

    def __len__(self) -> int:
        return len(_names(self._motor.client.profile))

    def __contains__(self, name: object) -> bool:
        return name in _names(self._motor.client.profile)

    def __repr__(self) -> str:
        return f"<names of {len(self)} registers of {self._motor!r}>"


@functools.cache
def _names(profile: str) -> dict[str, None]:
    """The names of a profile's registers, in the order of their numbers."""
    return dict.fromkeys(_core.st_registers(profile))
