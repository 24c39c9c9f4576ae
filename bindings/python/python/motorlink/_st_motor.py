"""Motors of ST's serial Motor Control Protocol, for both APIs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, one
from motorlink._arrival import moved, needs_wait
from motorlink._core import StRequest as Request
from motorlink._values import ControlMode, Flags, RevupPhase, Status
from motorlink.errors import InvalidValueError

if TYPE_CHECKING:
    from motorlink._st import StClient

ClientT = TypeVar("ClientT", bound="StClient[Any, Any, Any]")


class StMotor(Generic[ClientT]):
    """What the motors of both APIs have in common."""

    __slots__ = ("__weakref__", "_client", "_full_scale_amps", "_number", "_reads")

    def __init__(self, client: ClientT, number: int, full_scale_amps: float | None):
        self._client = client
        self._number = _core.st_motor(number)
        self._full_scale_amps = full_scale_amps
        self._reads: dict[tuple[str | int, bool], Request] = {}

    @property
    def client(self) -> ClientT:
        """The client of this motor."""
        return self._client

    @property
    def number(self) -> int:
        """The motor's number."""
        return self._number

    @property
    def full_scale_amps(self) -> float | None:
        """The current of digit 32767, A. ``None``: currents are in digits."""
        return self._full_scale_amps

    def _exchange(self, request: Request) -> Exchanges[Any]:
        given: Exchanges[Any] = self._client._exchange(self._number, request)
        return given

    def _settings(self) -> _core.MotorSettings:
        return _core.MotorSettings.st(self._number, self._client.profile)

    def _check(self, motor: int, request: Request) -> None:
        self._client._core.check(motor, request)

    def _confirm(self) -> Any:
        return self._client._confirm()

    @both_apis
    def get(self, register: str | int, *, raw: bool = False) -> Exchanges[float]:
        """Reads a register (0x02, 4.5) in its unit, or in digits with ``raw=True``.

        Returns an integer if one digit is one unit, otherwise a float. States and flags are numbers here:
        :meth:`status` and :meth:`flags` return them as text.

        Raises ``RefusedError`` if the drive cannot read it, ``UnknownRegisterError`` for an unknown name,
        ``ImplausibleValueError`` for a value that is possible in another profile only.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).get("BUS_VOLTAGE")       # V
        325
        """
        request = self._reads.get((register, raw))
        if request is None:
            request = Request.get_register(
                register,
                profile=self._client.profile,
                raw=raw,
                full_scale_amps=self._full_scale_amps,
            )
            self._reads[register, raw] = request
        return self._exchange(request)

    @both_apis
    def set(self, register: str | int, value: float | str, *, raw: bool = False) -> Exchanges[None]:
        """Writes a register (0x01, 4.4) in its unit, or in digits with ``raw=True``.

        ``CONTROL_MODE`` takes ``TORQUE`` and ``SPEED``. ``DAC_OUT1`` and ``DAC_OUT2`` take names of registers.
        A value between two digits raises ``InvalidValueError``; only currents in A are rounded.

        Raises ``RefusedError`` if the drive does not take the value.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).set("SPEED_KP", 1200)
        """
        return self._exchange(self._set(register, value, raw))

    @both_apis
    def set_verified(
        self, register: str | int, value: float | str, *, raw: bool = False, attempts: int = _core.ST_ATTEMPTS
    ) -> Exchanges[int]:
        """Writes a register and reads it back, at most ``attempts`` times. Returns the number of attempts.

        The checksum of a frame has 8 bits and does not detect all damage. The second exchange detects most of
        the rest.

        Raises ``RefusedError`` without a code if the register has another value after the last attempt,
        ``InvalidValueError`` if the register cannot be read back or if writing it moves the motor. If another
        task writes the register in between, that value is overwritten.
        """
        request = self._set(register, value, raw)
        return one(self._client._set_verified(self._number, request, attempts))

    def _set(self, register: str | int, value: float | str, raw: bool) -> Request:
        return Request.set_register(
            register,
            value,
            profile=self._client.profile,
            raw=raw,
            full_scale_amps=self._full_scale_amps,
        )

    @both_apis
    def status(self) -> Exchanges[Status]:
        """Reads the state of the drive's state machine: ``IDLE``, ``RUN``, ``FAULT_NOW`` (STATUS)."""
        return self._exchange(Request.status())

    @both_apis
    def flags(self) -> Exchanges[Flags]:
        """Reads the faults (FLAGS). The value is false if there are none."""
        return self._exchange(Request.flags())

    @both_apis
    def control_mode(self) -> Exchanges[ControlMode]:
        """Reads the control mode: ``TORQUE`` or ``SPEED`` (CONTROL_MODE)."""
        return self._exchange(Request.control_mode())

    @both_apis
    def execute(self, command: str | int) -> Exchanges[None]:
        """Executes a command of table 4 by its name, such as ``RESET``, or by its number (0x03, 4.6).

        An acknowledge does not mean that the command had an effect: read :meth:`status`.
        """
        return self._exchange(Request.execute_command(command))

    @both_apis
    def start(self) -> Exchanges[None]:
        """Starts the motor (4.6), then reads its state: two exchanges, three with a fault.

        A drive acknowledges a start in any case. Raises ``RefusedError`` without a code if a fault is pending,
        or if the motor is still stopping. The message names the faults.

        The drive acts in its control mode, also after a stop: in ``TORQUE`` mode the motor starts with the
        last current reference, and the load decides the speed. :meth:`set_ramp` returns to speed control.
        With a ``speed_limit_rpm``, call :meth:`set_ramp` first: the drive may keep an older target.
        """
        yield self._exchange(Request.execute_command("START_MOTOR"))
        starting = _core.StStarting(self._number)
        while (register := starting.register()) is not None:
            starting.replied((yield self._read(register)))

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor (4.6)."""
        return self._exchange(Request.execute_command("STOP_MOTOR"))

    @both_apis
    def stop_ramp(self) -> Exchanges[None]:
        """Stops the current ramp (4.6). The motor keeps its speed."""
        return self._exchange(Request.execute_command("STOP_RAMP"))

    @both_apis
    def fault_ack(self) -> Exchanges[None]:
        """Acknowledges faults that are over (4.6)."""
        return self._exchange(Request.execute_command("FAULT_ACK"))

    @both_apis
    def encoder_align(self) -> Exchanges[None]:
        """Aligns the encoder (4.6)."""
        return self._exchange(Request.execute_command("ENCODER_ALIGN"))

    @both_apis
    def start_stop(self) -> Exchanges[None]:
        """Starts the motor if it is stopped, otherwise stops it (4.6)."""
        return self._exchange(Request.execute_command("START_STOP"))

    @both_apis
    def iqdref_clear(self) -> Exchanges[None]:
        """Resets the current references to their values at power-on (4.6)."""
        return self._exchange(Request.execute_command("IQDREF_CLEAR"))

    @both_apis
    def pfc_enable(self) -> Exchanges[None]:
        """Switches the power factor correction on (4.6)."""
        return self._exchange(Request.execute_command("PFC_ENABLE"))

    @both_apis
    def pfc_disable(self) -> Exchanges[None]:
        """Switches the power factor correction off (4.6)."""
        return self._exchange(Request.execute_command("PFC_DISABLE"))

    @both_apis
    def pfc_fault_ack(self) -> Exchanges[None]:
        """Acknowledges faults of the power factor correction (4.6)."""
        return self._exchange(Request.execute_command("PFC_FAULT_ACK"))

    @both_apis
    def set_ramp(self, speed_rpm: float, duration_s: float) -> Exchanges[None]:
        """Ramps the speed to ``speed_rpm`` in ``duration_s`` (0x07, 4.8).

        In RUN the ramp starts at once, otherwise when the motor reaches RUN. Values are rounded to 1 rpm and
        1 ms. ``duration_s`` is 0, a step, to 65.535 s.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).set_ramp(1500, 1.0)      # rpm, s
        """
        return self._exchange(Request.set_ramp(speed_rpm, duration_s))

    @both_apis
    def set_current_reference(self, iq: float, id: float) -> Exchanges[None]:
        """Sets the current references Iq and Id (0x0A, 4.11), in A with ``full_scale_amps``, otherwise in digits.

        A ``speed_limit_rpm`` does not hold then.
        """
        return self._exchange(Request.set_current_reference(iq, id, full_scale_amps=self._full_scale_amps))

    @both_apis
    def set_torque_ramp(self, torque: float, duration_s: float) -> Exchanges[None]:
        """Ramps the torque current Iq to ``torque`` in ``duration_s`` (0x0D of profile ``mcsdk-5.4``).

        ``torque`` is in A with ``full_scale_amps``, otherwise in digits. A ``speed_limit_rpm`` does not hold
        then. Raises ``InvalidValueError`` with another profile, where these bytes are another command.
        """
        self._only("mcsdk-5.4", "torque ramps")
        full_scale_amps = self._full_scale_amps
        return self._exchange(
            Request.set_torque_ramp(torque, duration_s, full_scale_amps=full_scale_amps)
        )

    @both_apis
    def set_position(
        self,
        angle_rad: float,
        duration_s: float,
        *,
        wait: bool = False,
        arrival_tolerance_rad: float | None = None,
        timeout: float | None = None,
    ) -> Exchanges[None]:
        """Turns to ``angle_rad`` in ``duration_s`` (0x12 of profile ``mcsdk-5.4``, with position control).

        Raises ``InvalidValueError`` if there is a ``speed_limit_rpm``: the command has no speed.

        ``wait=True`` returns when the motor has arrived: ``duration_s`` is over, it is at most
        ``arrival_tolerance_rad`` from the target (by default 0.01) and its position does not change for
        0.25 s. Otherwise ``NotArrivedError`` is raised, and the motor still has its command. A motor that is
        not in RUN, nor on its way there, gets no command. ``timeout``, s, is by default ``duration_s`` and
        10 s. Without ``wait=True`` both arguments are refused.
        """
        self._only("mcsdk-5.4", "moves")
        request = Request.set_position(angle_rad, duration_s)
        needs_wait(wait, arrival_tolerance_rad=arrival_tolerance_rad, timeout=timeout)
        move = self._sent(request)
        if wait:
            watch = _core.st_arrival(
                self._number, angle_rad, duration_s, arrival_tolerance_rad, timeout
            )
            move = moved(self._client, watch, self._read, self._confirm, move)
        yield from move

    def _sent(self, request: Request) -> Exchanges[None]:
        yield self._exchange(request)

    def _read(self, register: int) -> Any:
        return self._client._exchange_raw(self._number, 0x02, bytes([register]))

    @both_apis
    def revup_data(self, phase: int) -> Exchanges[RevupPhase]:
        """Reads a phase of the rev-up, 0 to 4 (0x08, 4.9)."""
        request = Request.get_revup_data(phase, full_scale_amps=self._full_scale_amps)
        return self._exchange(request)

    @both_apis
    def set_revup_data(
        self, phase: int, speed_rpm: float, torque: float, duration_s: float
    ) -> Exchanges[None]:
        """Sets a phase of the rev-up, 0 to 4 (0x09, 4.10).

        ``speed_rpm`` and ``torque`` are the values at the end of the phase, ``duration_s`` is its length.
        ``torque`` is Iq, in A with ``full_scale_amps``, otherwise in digits.
        """
        full_scale_amps = self._full_scale_amps
        return self._exchange(
            Request.set_revup_data(
                phase, speed_rpm, torque, duration_s, full_scale_amps=full_scale_amps
            )
        )

    @both_apis
    def configure_segment(self, segment: int, registers: Sequence[str | int]) -> Exchanges[None]:
        """Selects the registers of a data segment, 0 to 3 (0x0E, profile ``spec``). At most 32.

        The drive has one set of segments for all its motors and keeps it until power-off.

        >>> import motorlink
        >>> with motorlink.st.open("sim:") as client:
        ...     client.motor(1).configure_segment(0, ["SPEED_MEAS", "BUS_VOLTAGE"])
        ...     client.motor(1).segment(0)
        {'SPEED_MEAS': 0, 'BUS_VOLTAGE': 325}
        """
        self._only("spec", "data segments")
        request = Request.configure_segment(segment, registers)
        self._client._segments.claim(segment)
        yield self._exchange(request)
        self._client._segments.chosen(segment, registers)

    @both_apis
    def segment(
        self, segment: int, registers: Sequence[str | int] | None = None, *, raw: bool = False
    ) -> Exchanges[dict[str, float]]:
        """Reads a data segment (0x0D, profile ``spec``). Returns the values of its registers by name.

        Call :meth:`configure_segment` first, also after the port was opened again. Otherwise
        ``InvalidValueError`` is raised and nothing is sent: shipped firmware reads this request as a torque
        ramp. ``registers`` are those that the segment was configured with, and may be left out.
        """
        self._only("spec", "data segments")
        if registers is None:
            registers = self._client._segments.registers(segment)
        request = Request.get_segment(
            segment, registers, raw=raw, full_scale_amps=self._full_scale_amps
        )
        return self._exchange(request)

    def _only(self, profile: str, what: str) -> None:
        """Raises if the client has another profile."""
        client = self._client
        if client.profile != profile:
            raise InvalidValueError(
                f"{what} need profile {profile}, and {client.port} was opened with profile"
                f" {client.profile}; nothing was sent",
                port=client.port,
                motor=self._number,
            )

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Motor {self._number} on {self._client.port}>"
