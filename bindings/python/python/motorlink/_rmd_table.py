"""The commands of RMD V1.62, written by `make python-table` from the table of crates/proto."""

from __future__ import annotations

from typing import Any, NamedTuple

from motorlink import _core
from motorlink._apis import Exchanges, both_apis, fields, one
from motorlink._values import Errors

__all__ = [
    "Encoder",
    "MotionStatus",
    "PhaseCurrents",
    "Pid",
    "Request",
    "Status",
    "clear_errors",
    "off",
    "read_acceleration",
    "read_encoder",
    "read_motion_status",
    "read_multi_turn_angle",
    "read_phase_currents",
    "read_pid",
    "read_single_turn_angle",
    "read_status",
    "run",
    "set_position",
    "set_position_limited",
    "set_single_turn_position",
    "set_single_turn_position_limited",
    "set_speed",
    "set_torque",
    "stop",
    "write_acceleration_ram",
    "write_encoder_offset_rom",
    "write_pid_ram",
    "write_pid_rom",
    "write_zero_rom",
]


class Pid(NamedTuple):
    """Reply to 0x30 (Read PID parameter command)."""

    position_kp: int
    position_ki: int
    speed_kp: int
    speed_ki: int
    torque_kp: int
    torque_ki: int


class Encoder(NamedTuple):
    """Reply to 0x90 (Read encoder data command)."""

    position: int
    raw: int
    offset: int


class Status(NamedTuple):
    """Reply to 0x9A, 0x9B (Read motor status 1 and error flag commands)."""

    #: A digit is 1 °C.
    temperature_celsius: int
    #: A digit is 0.1 V.
    voltage_volts: float
    errors: Errors


class MotionStatus(NamedTuple):
    """Reply to 0x9C, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6 (Read motor status 2)."""

    #: A digit is 1 °C.
    temperature_celsius: int
    #: A digit is 0.01611328125 A.
    iq_amps: float
    #: A digit is 1 °/s.
    speed_dps: float
    encoder: int


class PhaseCurrents(NamedTuple):
    """Reply to 0x9D (Read motor status 3)."""

    #: A digit is 0.015625 A.
    phase_a_amps: float
    #: A digit is 0.015625 A.
    phase_b_amps: float
    #: A digit is 0.015625 A.
    phase_c_amps: float


class Request(_core.RmdRequest):
    """A request to an RMD motor. It checks its arguments and reads its reply.

    With ``gear_ratio`` angles, speeds and accelerations are those of the output shaft, in the request
    and in the reply. Otherwise they are those of the motor shaft.
    """

    __slots__ = ()

    @staticmethod
    def read_pid() -> Request:
        """Reads the gains in RAM.

        0x30: Read PID parameter command.
        """
        return Request(_core.rmd_encode(0x30))

    @staticmethod
    def write_pid_ram(
        *,
        position_kp: int,
        position_ki: int,
        speed_kp: int,
        speed_ki: int,
        torque_kp: int,
        torque_ki: int,
    ) -> Request:
        """Sets the gains until power-off.

        0x31: Write PID to RAM parameter command.
        """
        return Request(
            _core.rmd_encode(
                0x31,
                position_kp,
                position_ki,
                speed_kp,
                speed_ki,
                torque_kp,
                torque_ki,
            )
        )

    @staticmethod
    def write_pid_rom(
        *,
        position_kp: int,
        position_ki: int,
        speed_kp: int,
        speed_ki: int,
        torque_kp: int,
        torque_ki: int,
    ) -> Request:
        """Sets the gains for good.

        0x32: Write PID to ROM parameter command.
        Wears the ROM.
        """
        return Request(
            _core.rmd_encode(
                0x32,
                position_kp,
                position_ki,
                speed_kp,
                speed_ki,
                torque_kp,
                torque_ki,
            )
        )

    @staticmethod
    def read_acceleration(*, gear_ratio: float | None = None) -> Request:
        """Reads the acceleration limit.

        0x33: Read acceleration data command.
        Gives the acceleration, °/s².
        0 means no limit.
        """
        data = _core.rmd_encode(0x33, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def write_acceleration_ram(
        acceleration_dps2: float,
        *,
        gear_ratio: float | None = None,
    ) -> Request:
        """Sets the acceleration limit until power-off.

        0x34: Write acceleration data to RAM command.
        ``acceleration_dps2`` is 0 to 2147483647.
        0 means no limit.
        """
        data = _core.rmd_encode(0x34, acceleration_dps2, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def read_encoder() -> Request:
        """Reads encoder position, original position and offset.

        0x90: Read encoder data command.
        """
        return Request(_core.rmd_encode(0x90))

    @staticmethod
    def write_encoder_offset_rom(offset: int) -> Request:
        """Sets the encoder offset, at once and for good.

        0x91: Write encoder offset command.
        Gives the offset.
        Wears the ROM.
        """
        return Request(_core.rmd_encode(0x91, offset))

    @staticmethod
    def write_zero_rom() -> Request:
        """Makes the current position the zero effective after the next power cycle.

        0x19: Write current position to ROM as motor zero position command.
        Gives the offset.
        Wears the ROM.
        """
        return Request(_core.rmd_encode(0x19))

    @staticmethod
    def read_multi_turn_angle(*, gear_ratio: float | None = None) -> Request:
        """Reads the angle over all turns.

        0x92: Read multi turns angle command.
        Gives the angle, °.
        """
        data = _core.rmd_encode(0x92, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def read_single_turn_angle(*, gear_ratio: float | None = None) -> Request:
        """Reads the angle within the turn.

        0x94: Read single circle angle command.
        Gives the angle, °.
        """
        data = _core.rmd_encode(0x94, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def read_status() -> Request:
        """Reads temperature, voltage and error flags.

        0x9A: Read motor status 1 and error flag commands.
        """
        return Request(_core.rmd_encode(0x9A))

    @staticmethod
    def clear_errors() -> Request:
        """Clears the error flags whose cause is gone.

        0x9B: Clear motor error flag command.
        """
        return Request(_core.rmd_encode(0x9B))

    @staticmethod
    def read_motion_status(*, gear_ratio: float | None = None) -> Request:
        """Reads temperature, torque current, speed and encoder position.

        0x9C: Read motor status 2.
        """
        data = _core.rmd_encode(0x9C, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def read_phase_currents() -> Request:
        """Reads the three phase currents.

        0x9D: Read motor status 3.
        """
        return Request(_core.rmd_encode(0x9D))

    @staticmethod
    def off() -> Request:
        """Switches the motor off and forgets what it was doing.

        0x80: Motor off command.
        """
        return Request(_core.rmd_encode(0x80))

    @staticmethod
    def stop() -> Request:
        """Stops the motor and remembers what it was doing.

        0x81: Motor stop command.
        """
        return Request(_core.rmd_encode(0x81))

    @staticmethod
    def run() -> Request:
        """Resumes what the motor was doing before the stop.

        0x88: Motor running command.
        """
        return Request(_core.rmd_encode(0x88))

    @staticmethod
    def set_torque(iq_amps: float, *, gear_ratio: float | None = None) -> Request:
        """Holds a torque current.

        0xA1: Torque current control command.
        ``iq_amps`` is -32 to 32.
        """
        data = _core.rmd_encode(0xA1, iq_amps, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def set_speed(speed_dps: float, *, gear_ratio: float | None = None) -> Request:
        """Holds a speed.

        0xA2: Speed control command.
        """
        data = _core.rmd_encode(0xA2, speed_dps, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def set_position(angle_degrees: float, *, gear_ratio: float | None = None) -> Request:
        """Turns to a multi-turn angle.

        0xA3: Position control command 1.
        """
        data = _core.rmd_encode(0xA3, angle_degrees, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def set_position_limited(
        *,
        max_speed_dps: float,
        angle_degrees: float,
        gear_ratio: float | None = None,
    ) -> Request:
        """Turns to a multi-turn angle no faster than a limit.

        0xA4: Position control command 2.
        ``max_speed_dps`` is 1 to 65535.
        """
        data = _core.rmd_encode(0xA4, max_speed_dps, angle_degrees, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def set_single_turn_position(
        *,
        direction: str,
        angle_degrees: float,
        gear_ratio: float | None = None,
    ) -> Request:
        """Turns to an angle within the turn, in a given direction.

        0xA5: Position control command 3.
        ``angle_degrees`` is 0 to 359.99.
        ``direction`` is ``clockwise`` or ``counterclockwise``.
        """
        data = _core.rmd_encode(0xA5, direction, angle_degrees, gear_ratio=gear_ratio)
        return Request(data, gear_ratio=gear_ratio)

    @staticmethod
    def set_single_turn_position_limited(
        *,
        direction: str,
        max_speed_dps: float,
        angle_degrees: float,
        gear_ratio: float | None = None,
    ) -> Request:
        """Turns to an angle within the turn, in a given direction, no faster than a limit.

        0xA6: Position control command 4.
        ``max_speed_dps`` is 1 to 65535.
        ``angle_degrees`` is 0 to 359.99.
        ``direction`` is ``clockwise`` or ``counterclockwise``.
        """
        data = _core.rmd_encode(
            0xA6, direction, max_speed_dps, angle_degrees, gear_ratio=gear_ratio
        )
        return Request(data, gear_ratio=gear_ratio)


# Requests for ``Client.cycle``, without the check for a full turn.
read_pid = Request.read_pid
write_pid_ram = Request.write_pid_ram
write_pid_rom = Request.write_pid_rom
read_acceleration = Request.read_acceleration
write_acceleration_ram = Request.write_acceleration_ram
read_encoder = Request.read_encoder
write_encoder_offset_rom = Request.write_encoder_offset_rom
write_zero_rom = Request.write_zero_rom
read_multi_turn_angle = Request.read_multi_turn_angle
read_single_turn_angle = Request.read_single_turn_angle
read_status = Request.read_status
clear_errors = Request.clear_errors
read_motion_status = Request.read_motion_status
read_phase_currents = Request.read_phase_currents
off = Request.off
stop = Request.stop
run = Request.run
set_torque = Request.set_torque
set_speed = Request.set_speed
set_position = Request.set_position
set_position_limited = Request.set_position_limited
set_single_turn_position = Request.set_single_turn_position
set_single_turn_position_limited = Request.set_single_turn_position_limited


class MotorCommands:
    """The commands of a motor, one exchange each, for both APIs."""

    __slots__ = ()

    _exchange: Any
    _gear_ratio: float | None

    @both_apis
    def pid(self) -> Exchanges[Pid]:
        """Reads the gains in RAM.

        0x30: Read PID parameter command.
        """
        return one(self._exchange(Request.read_pid()))

    @both_apis
    def write_pid_ram(self, pid: Pid) -> Exchanges[None]:
        """Sets the gains until power-off.

        0x31: Write PID to RAM parameter command.
        """
        return one(self._exchange(Request.write_pid_ram(**fields(pid, Pid, "pid"))))

    @both_apis
    def write_pid_rom(self, pid: Pid) -> Exchanges[None]:
        """Sets the gains for good.

        0x32: Write PID to ROM parameter command.
        Wears the ROM.
        """
        return one(self._exchange(Request.write_pid_rom(**fields(pid, Pid, "pid"))))

    @both_apis
    def acceleration(self) -> Exchanges[float]:
        """Reads the acceleration limit.

        0x33: Read acceleration data command.
        Gives the acceleration, °/s².
        0 means no limit.
        """
        request = Request.read_acceleration(gear_ratio=self._gear_ratio)
        return one(self._exchange(request))

    @both_apis
    def write_acceleration_ram(self, acceleration_dps2: float) -> Exchanges[None]:
        """Sets the acceleration limit until power-off.

        0x34: Write acceleration data to RAM command.
        ``acceleration_dps2`` is 0 to 2147483647.
        0 means no limit.
        """
        request = Request.write_acceleration_ram(acceleration_dps2, gear_ratio=self._gear_ratio)
        return one(self._exchange(request))

    @both_apis
    def encoder(self) -> Exchanges[Encoder]:
        """Reads encoder position, original position and offset.

        0x90: Read encoder data command.
        """
        return one(self._exchange(Request.read_encoder()))

    @both_apis
    def write_encoder_offset_rom(self, offset: int) -> Exchanges[int]:
        """Sets the encoder offset, at once and for good.

        0x91: Write encoder offset command.
        Gives the offset.
        Wears the ROM.
        """
        return one(self._exchange(Request.write_encoder_offset_rom(offset)))

    @both_apis
    def write_zero_rom(self) -> Exchanges[int]:
        """Makes the current position the zero effective after the next power cycle.

        0x19: Write current position to ROM as motor zero position command.
        Gives the offset.
        Wears the ROM.
        """
        return one(self._exchange(Request.write_zero_rom()))

    @both_apis
    def multi_turn_angle(self) -> Exchanges[float]:
        """Reads the angle over all turns.

        0x92: Read multi turns angle command.
        Gives the angle, °.
        """
        request = Request.read_multi_turn_angle(gear_ratio=self._gear_ratio)
        return one(self._exchange(request))

    @both_apis
    def single_turn_angle(self) -> Exchanges[float]:
        """Reads the angle within the turn.

        0x94: Read single circle angle command.
        Gives the angle, °.
        """
        request = Request.read_single_turn_angle(gear_ratio=self._gear_ratio)
        return one(self._exchange(request))

    @both_apis
    def status(self) -> Exchanges[Status]:
        """Reads temperature, voltage and error flags.

        0x9A: Read motor status 1 and error flag commands.
        """
        return one(self._exchange(Request.read_status()))

    @both_apis
    def clear_errors(self) -> Exchanges[Status]:
        """Clears the error flags whose cause is gone.

        0x9B: Clear motor error flag command.
        """
        return one(self._exchange(Request.clear_errors()))

    @both_apis
    def motion_status(self) -> Exchanges[MotionStatus]:
        """Reads temperature, torque current, speed and encoder position.

        0x9C: Read motor status 2.
        """
        request = Request.read_motion_status(gear_ratio=self._gear_ratio)
        return one(self._exchange(request))

    @both_apis
    def phase_currents(self) -> Exchanges[PhaseCurrents]:
        """Reads the three phase currents.

        0x9D: Read motor status 3.
        """
        return one(self._exchange(Request.read_phase_currents()))

    @both_apis
    def off(self) -> Exchanges[None]:
        """Switches the motor off and forgets what it was doing.

        0x80: Motor off command.
        """
        return one(self._exchange(Request.off()))

    @both_apis
    def stop(self) -> Exchanges[None]:
        """Stops the motor and remembers what it was doing.

        0x81: Motor stop command.
        """
        return one(self._exchange(Request.stop()))

    @both_apis
    def run(self) -> Exchanges[None]:
        """Resumes what the motor was doing before the stop.

        0x88: Motor running command.
        """
        return one(self._exchange(Request.run()))

    @both_apis
    def set_torque(self, iq_amps: float) -> Exchanges[MotionStatus]:
        """Holds a torque current.

        0xA1: Torque current control command.
        ``iq_amps`` is -32 to 32.
        """
        request = Request.set_torque(iq_amps, gear_ratio=self._gear_ratio)
        return one(self._exchange(request))

    @both_apis
    def set_speed(self, speed_dps: float) -> Exchanges[MotionStatus]:
        """Holds a speed.

        0xA2: Speed control command.
        """
        request = Request.set_speed(speed_dps, gear_ratio=self._gear_ratio)
        return one(self._exchange(request))
