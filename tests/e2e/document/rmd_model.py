"""One RMD motor: RAM, ROM, protections and a plain mechanical model.

Nothing here knows about CAN.  Angles are degrees of the shaft, clockwise is
positive; speeds are dps; currents are ampere.
"""
import math

# Ways to run
OFF, TORQUE, SPEED, POSITION = "off", "torque", "speed", "position"

LOW_VOLTAGE = 0x01          # "Error State" bit 0
OVER_TEMPERATURE = 0x08     # "Error State" bit 3

IQ_REPLY_PER_AMPERE = 2048 / 33.0       # reply: -2048~2048 is -33A~33A
IQ_COMMAND_PER_AMPERE = 2000 / 32.0     # command: -2000~2000 is -32A~32A
PHASE_PER_AMPERE = 64                   # status 3: 1A/64LSB

POLE_PAIRS = 14
SPEED_TAU = 0.02            # speed loop, seconds
COAST_TAU = 0.3             # slowing down without current
DPS_PER_AMPERE = 400.0      # steady speed of the bare motor per ampere
TORQUE_TAU = 0.3            # inertia / friction
POSITION_GAIN = 20.0        # dps per degree near the target
DEFAULT_ACCEL = 10000       # dps/s
TOP_SPEED = 6000.0          # what the machine can do at all
VOLTS_MIN = 12.0            # below: low voltage protection
DEGREES_MAX = 85.0          # above: over temperature protection


class Limits:
    """The values that the document says are set "in the host computer"."""

    def __init__(self, speed=1440.0, current=20.0, angle=0.0):
        self.speed = speed          # Max Speed, dps
        self.current = current      # Max Torque Current, A
        self.angle = angle          # Max Angle, degrees; 0 = none


class Rom:
    """What stays when the power is turned off."""

    def __init__(self):
        self.pid = bytes([100, 100, 50, 40, 50, 50])
        self.accel = DEFAULT_ACCEL
        self.offset = 0             # encoder zero, LSB


class RmdMotor:
    """RAM state of one motor and its motion."""

    def __init__(self, limits, encoder_bits=14):
        self.limits = limits
        self.counts = 1 << encoder_bits
        self.rom = Rom()
        self.shaft = 0.0            # true position, degrees, unbounded
        self.volts = 24.0
        self.celsius = 30.0
        self.power_up()

    def power_up(self):
        """Power off and on again: RAM is loaded from ROM."""
        self.pid = self.rom.pid
        self.accel = self.rom.accel
        self.offset = self.rom.offset
        self.mode = OFF
        self.stopped = False
        self.target = 0.0           # A, dps or degrees: as the mode says
        self.limit = 0.0            # dps, position modes
        self.speed = 0.0
        self.iq = 0.0
        self.error = 0
        # The turns are not kept: counting starts at the single-turn angle.
        self.turns_zero = self.shaft - self.circle_angle()

    # ---- what can be read -----------------------------------------------

    def encoder_raw(self):
        """Encoder original position, LSB."""
        return int(math.floor(self.shaft / 360.0 * self.counts + 1e-6)) % self.counts

    def encoder(self):
        """Encoder position: original position minus encoder offset."""
        return (self.encoder_raw() - self.offset) % self.counts

    def circle_angle(self):
        """Single-turn angle from the encoder zero, 0 <= degrees < 360."""
        angle = (self.shaft - self.offset * 360.0 / self.counts) % 360.0
        return 0.0 if angle > 359.995 else angle

    def multi_angle(self):
        """Cumulative angle, degrees."""
        return self.shaft - self.turns_zero

    def phase_currents(self):
        """iA, iB, iC in ampere; their sum is 0."""
        electrical = math.radians(self.shaft * POLE_PAIRS)
        shifts = (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)
        return [-self.iq * math.sin(electrical - shift) for shift in shifts]

    # ---- commands -------------------------------------------------------

    def off(self):
        """0x80: turn off, clear the running state and earlier commands."""
        self.mode = OFF
        self.stopped = False
        self.target = self.limit = 0.0

    def stop(self):
        """0x81: stop, but keep the running state and earlier commands."""
        self.stopped = True

    def resume(self):
        """0x88: back to the control mode before the stop."""
        self.stopped = False

    def run_torque(self, amperes):
        """0xA1, 0x280: not limited by Max Torque Current."""
        self._run(TORQUE, max(-32.0, min(32.0, amperes)))

    def run_speed(self, dps):
        """0xA2."""
        self._run(SPEED, dps)

    def run_position(self, degrees, max_speed=None):
        """0xA3, 0xA4: multi-turn; Max Speed counts only without max_speed."""
        if self.limits.angle:
            degrees = max(-self.limits.angle, min(self.limits.angle, degrees))
        self._run(POSITION, degrees, max_speed)

    def run_single_turn(self, degrees, counterclockwise, max_speed=None):
        """0xA5, 0xA6: to an angle within one turn, in the given direction."""
        way = (degrees - self.circle_angle()) % 360.0
        if way < 0.005 or way > 359.995:
            way = 0.0
        elif counterclockwise:
            way -= 360.0
        self._run(POSITION, self.multi_angle() + way, max_speed)

    def _run(self, mode, target, max_speed=None):
        if self.error:
            return                  # a protection is on: answered, not obeyed
        self.mode, self.target, self.stopped = mode, target, False
        self.limit = self.limits.speed if max_speed is None else max_speed

    def clear_error(self):
        """0x9B: flags go only where the cause is gone."""
        self.error = self._causes()

    def zero_to_rom(self):
        """0x19: present raw position becomes the zero after the next power-on."""
        self.rom.offset = self.encoder_raw()
        return self.rom.offset

    # ---- real time ------------------------------------------------------

    def advance(self, dt):
        """Let dt seconds pass (at most a few milliseconds)."""
        self._protect()
        old = self.speed
        if self.mode == OFF:
            self._ease(0.0, dt, COAST_TAU)
            self.iq = 0.0
        elif self.mode == TORQUE and not self.stopped:
            self.iq = self.target
            self._ease(self.iq * DPS_PER_AMPERE, dt, TORQUE_TAU)
        else:
            self._drive(self._wanted_speed(dt), dt)
        self.speed = max(-TOP_SPEED, min(TOP_SPEED, self.speed))
        self.shaft += (old + self.speed) / 2.0 * dt
        self._settle()

    def _causes(self):
        low = LOW_VOLTAGE if self.volts < VOLTS_MIN else 0
        return low | (OVER_TEMPERATURE if self.celsius > DEGREES_MAX else 0)

    def _protect(self):
        self.error |= self._causes()
        if self.error:
            self.off()

    def _ease(self, target, dt, tau):
        self.speed += (target - self.speed) * (1.0 - math.exp(-dt / tau))
        if abs(self.speed - target) < 0.001:
            self.speed = target

    def _acceleration(self):
        return float(self.accel) if self.accel > 0 else float(DEFAULT_ACCEL)

    def _wanted_speed(self, dt):
        if self.stopped:
            return 0.0
        if self.mode == SPEED:
            return self.target
        way = self.target - self.multi_angle()
        brake = math.sqrt(2.0 * self._acceleration() * 0.8 * abs(way))
        speed = min(self.limit, brake, POSITION_GAIN * abs(way))
        return math.copysign(speed, way)

    def _drive(self, wanted, dt):
        """First order towards `wanted`, acceleration and current limited."""
        old = self.speed
        self._ease(wanted, dt, SPEED_TAU)
        most = self._acceleration() * dt
        self.speed = max(old - most, min(old + most, self.speed))
        # iq = friction * speed + inertia * acceleration, in ampere
        inertia = TORQUE_TAU / DPS_PER_AMPERE
        iq = old / DPS_PER_AMPERE + inertia * (self.speed - old) / dt
        self.iq = max(-self.limits.current, min(self.limits.current, iq))
        if self.iq != iq:
            self.speed = old + (self.iq - old / DPS_PER_AMPERE) / inertia * dt

    def _settle(self):
        """Stop exactly on the target when near it."""
        if self.mode != POSITION or self.stopped or self.limit == 0:
            return
        if abs(self.target - self.multi_angle()) < 0.01 and abs(self.speed) < 2.0:
            self.shaft = self.turns_zero + self.target
            self.speed = 0.0
