"""Motors of the RMD protocol, for both APIs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis
from motorlink._arrival import moved, needs_wait
from motorlink._rmd_table import MotionStatus, MotorCommands, Request
from motorlink.errors import LinkError, PortError, ReplyTimeoutError

if TYPE_CHECKING:
    from motorlink._rmd import RmdClient

ClientT = TypeVar("ClientT", bound="RmdClient[Any, Any, Any]")


class RmdMotor(MotorCommands, Generic[ClientT]):
    """What the motors of both APIs have in common."""

    __slots__ = ("__weakref__", "_client", "_gear_ratio", "_id")

    def __init__(self, client: ClientT, id: int):
        self._client = client
        self._id = _core.rmd_motor(id)
        self._gear_ratio: float | None = client._core.gear_ratio(id)

    @property
    def client(self) -> ClientT:
        """The client of this motor."""
        return self._client

    @property
    def id(self) -> int:
        """The motor's ID."""
        return self._id

    @property
    def gear_ratio(self) -> float | None:
        """The gear ratio of this motor. ``None``: angles and speeds are those of the motor shaft."""
        return self._gear_ratio

    def _exchange(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._client._exchange(self._id, request)
        return given

    def _settings(self) -> _core.MotorSettings:
        return _core.MotorSettings.rmd(self._id)

    def _check(self, motor: int, request: Request) -> None:
        """Nothing: no limit is about settings."""

    def _confirm(self) -> Any:
        return self._client._confirm(self._id)

    def _moved(
        self,
        request: Request,
        move: Exchanges[MotionStatus],
        wait: bool,
        tolerance_degrees: float | None,
        timeout: float | None,
    ) -> Exchanges[MotionStatus]:
        needs_wait(wait, arrival_tolerance_degrees=tolerance_degrees, timeout=timeout)
        if wait:
            watch = _core.rmd_arrival(self._id, request, tolerance_degrees, timeout)
            move = moved(self._client, watch, self._exchange, self._confirm, move)
        motion: MotionStatus = yield from move
        return motion

    def _sent(self, request: Request) -> Exchanges[MotionStatus]:
        motion: MotionStatus = yield self._exchange(request)
        return motion

    def _sent_if_short(
        self, request: Request, tolerance_degrees: float, full_turn: bool
    ) -> Exchanges[MotionStatus]:
        if not full_turn:
            angle = yield self._exchange(Request.read_single_turn_angle())
            request.check_full_turn(self._id, angle, tolerance_degrees)
        motion: MotionStatus = yield self._exchange(request)
        return motion

    def set_limits(
        self,
        *,
        current_limit_amps: float | None | Literal["unchanged"] = "unchanged",
        speed_limit_dps: float | None | Literal["unchanged"] = "unchanged",
        angle_limit_degrees: float | None | Literal["unchanged"] = "unchanged",
    ) -> None:
        """Changes the limits of this motor that are given. Sends nothing. ``None`` removes a limit.

        A limit that is not given stays as it is. Before the first call the limits of :func:`open` hold. They
        are rounded in the same way.
        """
        limits = {
            "current_limit_amps": current_limit_amps,
            "speed_limit_dps": speed_limit_dps,
            "angle_limit_degrees": angle_limit_degrees,
        }
        given = {name: limit for name, limit in limits.items() if limit != "unchanged"}
        self._client._core.set_limits(self._id, **given)

    @both_apis
    def off(self) -> Exchanges[None]:
        """Switches the motor off (0x80): it forgets its command, and a load that it holds falls.

        Repeats the request until the motor confirms it, at least 4 times and for 2 s (4 times if the port
        fails). An exception means that the motor may still turn.
        """
        yield from self._halted(Request.off())

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor (0x81): it holds still and keeps its command for :meth:`run`.

        Repeats the request until the motor confirms it, at least 4 times and for 2 s (4 times if the port
        fails). An exception means that the motor may still turn. A motor with a blocked rotor may still push
        after a stop; :meth:`off` removes the torque. With an acceleration limit a (°/s²) the stop takes v/a
        seconds from the speed v (°/s), and v²/(2a) degrees.
        """
        yield from self._halted(Request.stop())

    def _halted(self, request: Request) -> Exchanges[None]:
        client: Any = self._client
        give_up = client._now() + _core.RMD_STOP_TIME
        attempts = 0
        while True:
            attempts += 1
            try:
                yield self._exchange(request)
            except (LinkError, ReplyTimeoutError) as error:
                is_lost = isinstance(error, PortError)
                if attempts >= _core.RMD_STOP_ATTEMPTS and (is_lost or client._now() >= give_up):
                    raise
                yield client._pause(_core.RMD_STOP_PATIENCE if is_lost else _core.RMD_STOP_PAUSE)
            else:
                return

    @both_apis
    def set_position(
        self,
        angle_degrees: float,
        max_speed_dps: float | None = None,
        *,
        wait: bool = False,
        arrival_tolerance_degrees: float | None = None,
        timeout: float | None = None,
    ) -> Exchanges[MotionStatus]:
        """Turns to an angle over all turns, ° (0xA3; with ``max_speed_dps`` 0xA4). Returns the motion before it.

        ``max_speed_dps`` is at least 1 and is rounded down to whole °/s.

        ``wait=True`` returns when the motor has arrived: it is at most ``arrival_tolerance_degrees`` from
        the target (by default 0.1° at the motor shaft) and its angle does not change for 0.25 s. The result is
        the motion then. Otherwise ``NotArrivedError`` is raised, and the motor still has its command.
        ``timeout``, s, is by default twice the time of the distance at ``max_speed_dps`` and 10 s; 60 s
        without ``max_speed_dps``.
        Without ``wait=True`` both arguments are refused.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:
        ...     status = client.motor(1).set_position(90, max_speed_dps=500, wait=True)
        """
        if max_speed_dps is None:
            request = Request.set_position(angle_degrees, gear_ratio=self._gear_ratio)
        else:
            request = Request.set_position_limited(
                angle_degrees=angle_degrees,
                max_speed_dps=max_speed_dps,
                gear_ratio=self._gear_ratio,
            )
        move = self._sent(request)
        move = self._moved(request, move, wait, arrival_tolerance_degrees, timeout)
        status: MotionStatus = yield from move
        return status

    @both_apis
    def set_single_turn_position(
        self,
        angle_degrees: float,
        max_speed_dps: float | None = None,
        *,
        direction: str = "clockwise",
        full_turn: bool = False,
        tolerance_degrees: float = _core.RMD_FULL_TURN_TOLERANCE,
        wait: bool = False,
        arrival_tolerance_degrees: float | None = None,
        timeout: float | None = None,
    ) -> Exchanges[MotionStatus]:
        """Turns to an angle within the turn (0xA5; with ``max_speed_dps`` 0xA6). Returns the motion before it.

        ``angle_degrees`` is 0 to 359.99. ``direction`` is ``clockwise`` or ``counterclockwise``.
        ``max_speed_dps`` is at least 1 and is rounded down to whole °/s.

        The angle is read first. If the motor is at the target, or at most ``tolerance_degrees`` past it, the
        move could be nearly a full turn. Then ``FullTurnError`` is raised and the motor does not move.
        ``full_turn=True`` sends the move without this check.

        >>> import motorlink
        >>> with motorlink.rmd.open("sim:") as client:     # the motor is at 0 °
        ...     client.motor(1).set_single_turn_position(0)
        Traceback (most recent call last):
        motorlink.errors.FullTurnError: motor 1 is at 0.00°, 0.00° past 0.00° clockwise: ...
        """
        if max_speed_dps is None:
            request = Request.set_single_turn_position(
                angle_degrees=angle_degrees, direction=direction, gear_ratio=self._gear_ratio
            )
        else:
            request = Request.set_single_turn_position_limited(
                angle_degrees=angle_degrees,
                direction=direction,
                max_speed_dps=max_speed_dps,
                gear_ratio=self._gear_ratio,
            )
        _core.rmd_full_turn_tolerance(tolerance_degrees)
        move = self._sent_if_short(request, tolerance_degrees, full_turn)
        move = self._moved(request, move, wait, arrival_tolerance_degrees, timeout)
        status: MotionStatus = yield from move
        return status

    @both_apis
    def raw(self, data: bytes, *, rom: bool = False) -> Exchanges[bytes]:
        """Sends any eight bytes. Returns the eight bytes of the reply.

        Raises ``InvalidValueError`` for bytes that write to the ROM, which wears. ``rom=True`` allows them.
        """
        return self._exchange(Request.raw(data, rom=rom))

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._id} on {self._client.port}>"
