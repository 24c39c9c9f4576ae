"""The extension module. Its users are ``motorlink.st`` and ``motorlink.rmd``."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, final

from typing_extensions import Self, disjoint_base

from motorlink import _rmd
from motorlink._rmd_table import MotionStatus
from motorlink._scan import ScanResult
from motorlink._settings import SettingDifference
from motorlink._values import Frame, RegisterInfo
from motorlink.errors import MotorlinkError

__all__ = [
    "Arrival",
    "CanPort",
    "MotorSettings",
    "RecordedClient",
    "RecordingFile",
    "RecordingInProgress",
    "RMD_FULL_TURN_TOLERANCE",
    "RMD_QUARANTINE",
    "RMD_SCAN_WIDTH",
    "RMD_STOP_ATTEMPTS",
    "RMD_STOP_PATIENCE",
    "RMD_STOP_PAUSE",
    "RMD_STOP_TIME",
    "RMD_TIMEOUT",
    "RmdClient",
    "RmdEventClient",
    "RmdOptions",
    "RmdRequest",
    "RmdSampling",
    "SETTINGS_MAX_SIZE",
    "SettingsComparison",
    "SettingsSteps",
    "SimBench",
    "SimPort",
    "SimRecording",
    "SimServing",
    "ST_ATTEMPTS",
    "ST_BAUD_RATES",
    "ST_SCAN_TIMEOUT",
    "ST_SEGMENTS",
    "ST_TIMEOUT",
    "StClient",
    "StEventClient",
    "StOptions",
    "StRequest",
    "StSampling",
    "StStarting",
    "StVerifiedWrite",
    "__version__",
    "cli",
    "open_descriptors",
    "recorded_directions",
    "recorded_results",
    "rmd_arrival",
    "rmd_decode",
    "rmd_encode",
    "rmd_encoder_degrees",
    "rmd_errors_text",
    "rmd_full_turn_tolerance",
    "rmd_motor",
    "rmd_quantities",
    "sim_presets",
    "sim_run",
    "st_arrival",
    "st_flags_text",
    "st_motor",
    "st_register",
    "st_register_name",
    "st_registers",
    "st_scan_baud",
    "st_scan_rates",
]

__version__: str
#: How far past its target a motor is taken to be at it, °.
RMD_FULL_TURN_TOLERANCE: float
#: How long a late reply is awaited, s.
RMD_QUARANTINE: float
#: IDs that a scan asks at once.
RMD_SCAN_WIDTH: int
#: How often a stop is sent at least, before it has failed.
RMD_STOP_ATTEMPTS: int
RMD_STOP_PATIENCE: float
#: The pause before a stop is repeated, s.
RMD_STOP_PAUSE: float
#: How long a stop is repeated at least, s.
RMD_STOP_TIME: float
#: How long a reply is awaited, s.
RMD_TIMEOUT: float
#: How often a verified write is tried.
SETTINGS_MAX_SIZE: int
ST_ATTEMPTS: int
#: The rates that drives are built with, the most frequent first.
ST_BAUD_RATES: tuple[int, ...]
#: How long a reply is awaited in a scan, s.
ST_SCAN_TIMEOUT: float
#: How many data segments a drive has.
ST_SEGMENTS: int
#: How long a reply is awaited, s.
ST_TIMEOUT: float

def cli(program: Sequence[str], words: Sequence[str]) -> int: ...
def open_descriptors() -> list[int]: ...
def st_register(
    name: str | int, profile: str = "spec", full_scale_amps: float | None = None
) -> RegisterInfo: ...
def st_motor(number: int) -> int: ...
def st_register_name(name: str | int) -> str: ...
def st_registers(profile: str = "spec") -> list[str]: ...
def st_scan_baud(port: str, baud: int, timeout: float) -> ScanResult: ...
def st_scan_rates(port: str, rates: Sequence[int]) -> list[int]: ...
def st_flags_text(bits: int) -> str: ...
def st_arrival(
    motor: int,
    angle_rad: float,
    duration_s: float,
    tolerance_rad: float | None,
    timeout: float | None,
) -> Arrival: ...
def rmd_arrival(
    motor: int, request: RmdRequest, tolerance_degrees: float | None, timeout: float | None
) -> Arrival: ...
def rmd_decode(can_id: int, data: bytes, *, reply: bool) -> Frame: ...
def rmd_encode(
    code: int, *values: float | str, gear_ratio: float | None = None
) -> bytes: ...
def rmd_encoder_degrees(
    counts: int, *, encoder_bits: int, gear_ratio: float | None = None
) -> float: ...
def rmd_errors_text(bits: int) -> str: ...
def rmd_full_turn_tolerance(tolerance_degrees: float) -> None: ...
def rmd_motor(id: int) -> int: ...
def rmd_quantities() -> list[str]: ...
@final
class StRequest:
    """A request to an ST drive. It checks its arguments and reads its reply."""

    @staticmethod
    def get_register(
        register: str | int,
        *,
        profile: str = "spec",
        raw: bool = False,
        full_scale_amps: float | None = None,
    ) -> StRequest: ...
    @staticmethod
    def set_register(
        register: str | int,
        value: float | str,
        *,
        profile: str = "spec",
        raw: bool = False,
        full_scale_amps: float | None = None,
    ) -> StRequest: ...
    @staticmethod
    def set_register_bytes(register: str | int, value: bytes) -> StRequest: ...
    @staticmethod
    def status() -> StRequest: ...
    @staticmethod
    def flags() -> StRequest: ...
    @staticmethod
    def control_mode() -> StRequest: ...
    @staticmethod
    def execute_command(command: str | int) -> StRequest: ...
    @staticmethod
    def get_board_info() -> StRequest: ...
    @staticmethod
    def get_firmware_version() -> StRequest: ...
    @staticmethod
    def set_ramp(speed_rpm: float, duration_s: float) -> StRequest: ...
    @staticmethod
    def set_torque_ramp(
        torque: float, duration_s: float, *, full_scale_amps: float | None = None
    ) -> StRequest: ...
    @staticmethod
    def set_current_reference(
        iq: float, id: float, *, full_scale_amps: float | None = None
    ) -> StRequest: ...
    @staticmethod
    def set_position(angle_rad: float, duration_s: float) -> StRequest: ...
    @staticmethod
    def get_revup_data(phase: int, *, full_scale_amps: float | None = None) -> StRequest: ...
    @staticmethod
    def set_revup_data(
        phase: int,
        speed_rpm: float,
        torque: float,
        duration_s: float,
        *,
        full_scale_amps: float | None = None,
    ) -> StRequest: ...
    @staticmethod
    def configure_segment(segment: int, registers: Sequence[str | int]) -> StRequest: ...
    @staticmethod
    def get_segment(
        segment: int,
        registers: Sequence[str | int],
        *,
        raw: bool = False,
        full_scale_amps: float | None = None,
    ) -> StRequest: ...
    @staticmethod
    def get_profiler_info(steps: bytes) -> StRequest: ...
    @staticmethod
    def decode(frame: bytes, *, profile: str = "spec") -> tuple[int, StRequest]: ...
    def encode(self, motor: int = 0) -> bytes: ...
    def decode_reply(self, frame: bytes) -> Any: ...
    @property
    def code(self) -> str: ...
    @property
    def is_read(self) -> bool: ...
    @property
    def fields(self) -> dict[str, int | float | bytes]: ...

@final
class StOptions:
    """The checked options of a line with an ST drive."""

    def __new__(
        cls,
        *,
        profile: str,
        timeout: float,
        recovery: str,
        speed_limit_rpm: float | None,
        current_limit: float | None,
        full_scale_amps: float | None,
    ) -> StOptions: ...

@final
class Arrival:
    """What to ask a motor until it has arrived."""

    def next(self, now: float) -> tuple[str, Any]: ...
    def replied(self, now: float, data: bytes) -> None: ...
    def confirmed(self, now: float) -> None: ...
    def commanded(self, now: float) -> None: ...
    def lost(self, now: float) -> None: ...

@final
class StStarting:
    """Says which registers to read after an acknowledged START_MOTOR."""

    def __new__(cls, motor: int) -> StStarting: ...
    def register(self) -> int | None: ...
    def replied(self, data: bytes) -> None: ...

@final
class StClient:
    """A master on a serial line."""

    @staticmethod
    def open(port: str | SimPort, options: StOptions) -> StClient: ...
    def exchange(self, motor: int, request: StRequest) -> Any: ...
    def recorded(self, profile: str, segments: Sequence[int]) -> RecordedClient: ...
    def check(self, motor: int, request: StRequest) -> None: ...
    def set_verified(self, motor: int, request: StRequest, attempts: int) -> int: ...
    def confirm(self) -> None: ...
    @property
    def now(self) -> float: ...
    def pause(self, seconds: float) -> None: ...
    def raw(self, motor: int, code: int, payload: bytes) -> bytes: ...
    def sampling(
        self,
        profile: str,
        motors: Sequence[tuple[int, Sequence[str | int], float | None]],
        segments: Sequence[int],
        rate: float,
        seconds: float | None,
        raw: bool,
    ) -> StSampling: ...
    def sample(
        self, sampling: StSampling, skip: bool, most: int | None
    ) -> tuple[bytearray, int, BaseException | None]: ...
    @property
    def moving(self) -> list[int]: ...
    def close(self, *, stop: bool) -> list[tuple[int, MotorlinkError]]: ...
    @property
    def is_closed(self) -> bool: ...
    @property
    def port(self) -> str: ...

@disjoint_base
class RmdRequest:
    """A request to an RMD motor. It checks its arguments and reads its reply."""

    def __new__(
        cls, data: bytes, *, raw: bool = False, gear_ratio: float | None = None
    ) -> Self: ...
    @classmethod
    def raw(cls, data: bytes, *, rom: bool = False) -> Self: ...
    @classmethod
    def decode(cls, data: bytes) -> Self: ...
    def check_full_turn(
        self, motor: int, angle_degrees: float, tolerance_degrees: float
    ) -> None: ...
    def encode(self) -> bytes: ...
    def decode_reply(self, data: bytes) -> Any: ...
    @property
    def code(self) -> int: ...
    @property
    def stem(self) -> str | None: ...
    @property
    def gear_ratio(self) -> float | None: ...
    @property
    def is_rom(self) -> bool: ...

@final
class RmdOptions:
    """The checked options of a CAN bus with RMD motors."""

    def __new__(
        cls,
        *,
        timeout: float,
        quarantine: float,
        current_limit_amps: float | None,
        speed_limit_dps: float | None,
        angle_limit_degrees: float | None,
        gear_ratio: float | Mapping[int, float] | None,
    ) -> RmdOptions: ...

@final
class RmdClient:
    """A CAN bus with RMD motors."""

    @staticmethod
    def open(port: str | SimPort | CanPort, options: RmdOptions) -> RmdClient: ...
    def exchange(self, id: int, request: RmdRequest) -> Any: ...
    def recorded(self) -> RecordedClient: ...
    def confirm(self, id: int) -> None: ...
    @property
    def now(self) -> float: ...
    def pause(self, seconds: float) -> None: ...
    def cycle(self, requests: Sequence[tuple[int, RmdRequest]]) -> dict[int, Any]: ...
    def set_torque4(
        self, iq_amps: Sequence[float], expect: Sequence[int]
    ) -> dict[int, MotionStatus | MotorlinkError]: ...
    def scan(self, ids: Sequence[int]) -> list[_rmd.ScanResult]: ...
    def sampling(
        self,
        motors: Sequence[tuple[int, Sequence[str], float | None]],
        rate: float,
        seconds: float | None,
        raw: bool,
    ) -> RmdSampling: ...
    def sample(
        self, sampling: RmdSampling, skip: bool, most: int | None
    ) -> tuple[bytearray, int, BaseException | None]: ...
    def set_limits(self, id: int, **limits: float | None) -> None: ...
    def check_gear(self, id: int, request: RmdRequest) -> None: ...
    def gear_ratio(self, id: int) -> float | None: ...
    @property
    def moving(self) -> list[int]: ...
    def close(self, *, stop: bool, off: bool) -> list[tuple[int, MotorlinkError]]: ...
    @property
    def is_closed(self) -> bool: ...
    @property
    def port(self) -> str: ...

@final
class MotorSettings:
    """The settings of one motor."""

    @staticmethod
    def st(motor: int, profile: str) -> MotorSettings: ...
    @staticmethod
    def rmd(motor: int) -> MotorSettings: ...
    @property
    def motor(self) -> int: ...
    def dumping(self) -> SettingsSteps: ...
    def comparing(self, text: str) -> SettingsSteps: ...

@final
class SettingsSteps:
    """A dump, a comparison or a restore in progress."""

    def next(self) -> tuple[str, Any]: ...
    def answered(self, reply: bytes) -> None: ...
    def failed(self, error: BaseException) -> None: ...

@final
class SettingsComparison:
    """The settings of a motor, and those of a file."""

    def differences(self) -> list[SettingDifference]: ...
    def restoring(self, *, dry_run: bool, to_rom: bool, running: bool) -> SettingsSteps: ...

@final
class SimBench:
    """An ST drive and a bus of RMD motors on virtual time."""

    def __new__(
        cls,
        *,
        toml: str = "",
        json: str | None = None,
        path: str | None = None,
        seed: int | None = None,
    ) -> SimBench: ...
    def port(self, fault: str | None = None) -> SimPort: ...
    @property
    def profile(self) -> str: ...
    @property
    def now(self) -> float: ...
    def run(self, seconds: float) -> None: ...
    def execute(self, command: str) -> str: ...
    @property
    def signals(self) -> list[tuple[str, str]]: ...
    def truth(self, motor: str) -> dict[str, Any]: ...
    def record(self, signals: list[str], every: float) -> SimRecording: ...
    @property
    def state_hash(self) -> int: ...
    def serve(self, *, st: str | None = None, rmd: str | None = None) -> SimServing: ...

@final
class SimPort:
    """The line and the bus of a bench, with faults."""

@final
class SimRecording:
    """Signals that are recorded while time advances."""

    @property
    def every(self) -> int: ...
    def take(self) -> bytearray: ...
    def end(self) -> None: ...

@final
class SimServing:
    """Ports on which a bench is served until it ends."""

    @property
    def st(self) -> tuple[str, str] | None: ...
    @property
    def rmd(self) -> tuple[str, str] | None: ...
    def end(self) -> None: ...

def sim_run(text: str, path: str | None = None) -> dict[str, Any]: ...
def sim_presets() -> str: ...

@final
class StEventClient:
    """A master on a serial line, driven by an event loop."""

    @staticmethod
    def open(port: str, options: StOptions) -> StEventClient: ...
    @property
    def is_open(self) -> bool: ...
    def reopen(self) -> None: ...
    def fileno(self) -> int | None: ...
    def check(self, motor: int, request: StRequest) -> None: ...
    def begin(self, motor: int, request: StRequest) -> None: ...
    def begin_raw(self, motor: int, code: int, payload: bytes) -> None: ...
    def begin_confirmation(self) -> None: ...
    def sampling(
        self,
        profile: str,
        motors: Sequence[tuple[int, Sequence[str | int], float | None]],
        segments: Sequence[int],
        rate: float,
        seconds: float | None,
        raw: bool,
    ) -> StSampling: ...
    def begin_sampling(self, sampling: StSampling) -> None: ...
    def advance(self) -> tuple[bool, Any]: ...
    def abandon(self) -> None: ...
    @property
    def moving(self) -> list[int]: ...
    def close(self, *, stop: bool) -> list[tuple[int, MotorlinkError]]: ...
    @property
    def port(self) -> str: ...

@final
class StSampling:
    """Rows of registers, from the engine of the line. The client carries out its exchanges."""

    def begin(self, most: int | None) -> None: ...
    def next(self, skip: bool, most: int | None) -> float | None: ...
    def fail(self) -> None: ...
    def take(self) -> tuple[bytearray, int]: ...

@final
class StVerifiedWrite:
    """A verified write in an event loop: what to ask, one request after the other."""

    def __new__(
        cls, motor: int, request: StRequest, attempts: int, profile: str
    ) -> StVerifiedWrite: ...
    def request(self) -> StRequest: ...
    def answered(self, digits: int | None) -> int | None: ...
    def failed(self, error: BaseException) -> int | None: ...

@final
class RmdSampling:
    """Rows of quantities, from the engine of the bus. The client carries out its exchanges."""

    def begin(self, most: int | None) -> None: ...
    def next(self, skip: bool, most: int | None) -> float | None: ...
    @property
    def motors(self) -> list[int]: ...
    def fail(self) -> None: ...
    def take(self) -> tuple[bytearray, int]: ...

@final
class RmdEventClient:
    """A CAN bus with RMD motors, driven by an event loop."""

    @staticmethod
    def open(port: str | CanPort, options: RmdOptions) -> RmdEventClient: ...
    @property
    def is_open(self) -> bool: ...
    def reopen(self) -> None: ...
    def fileno(self) -> int | None: ...
    def ask(self, id: int, request: RmdRequest, *, patient: bool = True) -> None: ...
    def begin_confirmation(self, id: int) -> None: ...
    def confirmed(self, id: int) -> None: ...
    def sampling(
        self,
        motors: Sequence[tuple[int, Sequence[str], float | None]],
        rate: float,
        seconds: float | None,
        raw: bool,
    ) -> RmdSampling: ...
    def ask_sampling(self, id: int, sampling: RmdSampling) -> None: ...
    def look_for(self, id: int) -> None: ...
    def set_torque4(
        self, iq_amps: Sequence[float], expect: Sequence[int]
    ) -> None: ...
    def advance(self) -> tuple[float | None, list[tuple[int, Any]]]: ...
    def cancel(self, id: int) -> None: ...
    def check_limits(self, id: int, request: RmdRequest) -> None: ...
    def set_limits(self, id: int, **limits: float | None) -> None: ...
    def check_gear(self, id: int, request: RmdRequest) -> None: ...
    def gear_ratio(self, id: int) -> float | None: ...
    @property
    def moving(self) -> list[int]: ...
    def close(self, *, stop: bool, off: bool) -> list[tuple[int, MotorlinkError]]: ...
    @property
    def port(self) -> str: ...

@final
class CanPort:
    """A bus of python-can as a port; from ``motorlink.can.from_python_can``."""

    def __new__(cls, bus: Any, message: Any, name: str) -> CanPort: ...
    @property
    def name(self) -> str: ...

@final
class RecordedClient:
    """An open client to record."""

@final
class RecordingInProgress:
    """A recording in progress."""

    @staticmethod
    def start(
        ports: Sequence[str],
        clients: Sequence[RecordedClient],
        path: str | Path,
        signals: Sequence[str],
        rate: float,
        profile: str,
        timeout: float | None,
        motors: Sequence[int],
        ids: Sequence[int],
        settings: bool,
        force: bool,
        max_size: int | None,
        rotate_size: int | None,
        rotate_seconds: float | None,
        fsync: float | None,
        command: str,
    ) -> RecordingInProgress: ...
    @property
    def motors(self) -> list[str]: ...
    @property
    def is_here(self) -> bool: ...
    def status(
        self,
    ) -> tuple[
        float,
        list[Path],
        int,
        int,
        int,
        int,
        int,
        int,
        float | None,
        float | None,
        list[str],
        bool,
    ]: ...
    def begin_end(self) -> None: ...
    def finish(self, wait: float) -> bool: ...

@final
class RecordingFile:
    """An open recording."""

    @staticmethod
    def open(path: Path) -> RecordingFile: ...
    def tables(
        self,
    ) -> tuple[
        int,
        list[tuple[str, str, list[tuple[str, str, bytearray]], bytearray, bytearray]],
        list[tuple[float, int, str, str, str, str, str]],
        int,
    ]: ...
    def frames(
        self, label: str
    ) -> tuple[bytearray, bytearray, bytearray, bytearray, bytearray, bytes, int]: ...
    @property
    def lines(self) -> list[str]: ...
    @property
    def lost(self) -> str | None: ...
    @property
    def lost_bytes(self) -> int: ...
    @property
    def metadata(self) -> list[tuple[str, dict[str, str]]]: ...
    @property
    def about(self) -> dict[str, str]: ...
    @property
    def drives(
        self,
    ) -> list[tuple[str, str, str, str, str | None, int | None, list[str], str | None]]: ...

def recorded_directions() -> list[str]: ...
def recorded_results() -> list[str]: ...
