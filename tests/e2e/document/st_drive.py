"""One motor with its drive: state machine, ramps and a first-order machine.

Nothing here knows about frames.  Speeds are RPM, currents are s16A (32767 is
the full scale of the current measurement), times are seconds.
"""
import math

from st_registers import DEFAULTS

# States of register STATUS.  The document has no list: HOLES 9.
IDLE, ALIGNMENT, START, RUN = 0, 2, 4, 6
ANY_STOP, STOP, FAULT_NOW, FAULT_OVER = 7, 8, 10, 11

# Values of register CONTROL_MODE.  The document has no list: HOLES 9.
TORQUE_MODE, SPEED_MODE = 0, 1

REVUP_PHASES = 5            # 4.10: Phase "ranges from 0 to 4"
ALIGN_TIME = 0.5            # length of the encoder alignment
SENSORED_START_TIME = 0.02  # a motor with a sensor needs no revup
STANDSTILL = 5.0            # RPM below which a coasting motor counts as stopped

SPEED_TAU = 0.05            # speed follows its reference with this time constant
COAST_TAU = 0.15            # a motor without current slows down with this one
TORQUE_TAU = 0.5            # J / B: how fast torque turns into speed
DRAG = 2.0                  # s16A needed per RPM in steady state
POLE_PAIRS = 4
BUS_VOLTS = 24
HEATSINK_DEGREES = 32
WATTS_PER_S16A_RPM = 2.0e-5


class Motor:
    """State and model of one motor."""

    def __init__(self, sensors, has_pfc, max_speed, target):
        self.sensors = set(sensors)
        self.has_pfc = has_pfc
        self.max_speed = max_speed
        self.values = dict(DEFAULTS)
        self.state = IDLE
        self.since = 0.0            # seconds spent in this state
        self.mode = SPEED_MODE
        self.speed = 0.0
        self.speed_ref = 0.0
        self.iq = 0.0
        self.angle = 0.0            # electrical, radians
        self.torque_ref = 0
        self.flux_ref = 0
        self.final_speed = target   # programmed ramp, run on entering RUN
        self.duration = 0.0
        self.ramp = None            # (from, to, seconds, elapsed) while it runs
        self.revup = [(0, 1500, 50), (200, 1500, 100), (400, 1500, 100),
                      (400, 1500, 0), (400, 1500, 0)]
        self.faults_now = 0
        self.faults_past = 0
        self.pfc_on = False
        self.pfc_faults_now = 0
        self.pfc_faults_past = 0

    # ---- what the commands of Table 4 do --------------------------------

    def start(self):
        """START_MOTOR: nothing if started or in an error state."""
        if self.state == IDLE:
            self._enter(START)

    def stop(self):
        """STOP_MOTOR: nothing if there is nothing to stop (HOLES 11)."""
        if self.state in (ALIGNMENT, START, RUN):
            self._enter(ANY_STOP)

    def start_stop(self):
        """START_STOP: start if idle, stop if spinning, nothing on error."""
        if self.state == IDLE:
            self.start()
        else:
            self.stop()

    def stop_ramp(self):
        """STOP_RAMP: the reference stays where the ramp has brought it."""
        self.ramp = None

    def fault_ack(self):
        """FAULT_ACK: clears past faults if no fault condition is still true."""
        if self.faults_now:
            return
        self.faults_past = 0
        if self.state == FAULT_OVER:
            self._enter(IDLE)

    def encoder_align(self):
        """ENCODER_ALIGN: only from IDLE, only with an encoder."""
        if self.state == IDLE and "encoder" in self.sensors:
            self._enter(ALIGNMENT)

    def iqdref_clear(self):
        """IQDREF_CLEAR: both references back to their default, 0."""
        self.torque_ref = self.flux_ref = 0

    def pfc_enable(self):
        """PFC_ENABLE."""
        self.pfc_on = self.pfc_on or not (self.pfc_faults_now or self.pfc_faults_past)

    def pfc_disable(self):
        """PFC_DISABLE (HOLES 12)."""
        self.pfc_on = False

    def pfc_fault_ack(self):
        """PFC_FAULT_ACK."""
        if not self.pfc_faults_now:
            self.pfc_faults_past = 0

    # ---- references -----------------------------------------------------

    def set_ramp(self, final_speed, duration):
        """4.8: run now if in steady state, else when that state is reached."""
        self.mode = SPEED_MODE
        self.final_speed = max(-self.max_speed, min(self.max_speed, final_speed))
        self.duration = duration
        if self.state == RUN:
            self._begin_ramp()

    def set_current_ref(self, iq, id_):
        """4.11; the mode becomes torque mode (HOLES 15)."""
        self.torque_ref, self.flux_ref = iq, id_
        self.set_mode(TORQUE_MODE)

    def set_mode(self, mode):
        """CONTROL_MODE; in RUN, speed mode continues from the present speed."""
        if mode == self.mode:
            return
        self.mode = mode
        self.ramp = None
        if self.state == RUN:
            self.speed_ref = self.speed

    # ---- faults (from the control port only) ----------------------------

    def set_fault(self, mask, present):
        """A fault condition appears or goes."""
        if present:
            self.faults_now |= mask
            self.faults_past |= mask
            self._enter(FAULT_NOW)
        else:
            self.faults_now &= ~mask
            if self.state == FAULT_NOW and not self.faults_now:
                self._enter(FAULT_OVER)

    def set_pfc_fault(self, mask, present):
        """The same for the PFC."""
        if present:
            self.pfc_faults_now |= mask
            self.pfc_faults_past |= mask
            self.pfc_on = False
        else:
            self.pfc_faults_now &= ~mask

    # ---- real time ------------------------------------------------------

    def advance(self, dt):
        """Let dt seconds pass (dt at most a few milliseconds)."""
        self.since += dt
        old = self.speed
        if self.state == START:
            self._advance_start(dt)
        elif self.state == RUN:
            self._advance_run(dt)
        else:
            self._coast(dt)
        self.speed = max(-self.max_speed, min(self.max_speed, self.speed))
        self._advance_electrics(old, dt)
        self._change_state()

    def _enter(self, state):
        self.state = state
        self.since = 0.0
        self.ramp = None
        if state not in (START, RUN):
            self.speed_ref = 0.0
        if state == RUN:
            self.speed_ref = self.speed
            if self.mode == SPEED_MODE:
                self._begin_ramp()

    def _change_state(self):
        if self.state == ALIGNMENT and self.since >= ALIGN_TIME:
            self._enter(IDLE)
        elif self.state == START and self.since >= self._start_time():
            self._enter(RUN)
        elif self.state == ANY_STOP:
            self._enter(STOP)
        elif self.state == STOP and abs(self.speed) < STANDSTILL:
            self.speed = 0.0
            self._enter(IDLE)

    def _sensorless(self):
        return not self.sensors & {"encoder", "hall"}

    def _start_time(self):
        if self._sensorless():
            return sum(phase[2] for phase in self.revup) / 1000.0
        return SENSORED_START_TIME

    def _advance_start(self, dt):
        """Go through the revup phases: each ends at its Target Speed (4.9)."""
        if self._sensorless():
            left, begin = self.since * 1000.0, 0
            for speed, _torque, duration in self.revup:
                if left < duration:
                    begin += (speed - begin) * left / duration
                    break
                left -= duration
                begin = speed
            self.speed_ref = -begin if self.final_speed < 0 else begin
        self._follow(self.speed_ref, dt, SPEED_TAU)

    def _begin_ramp(self):
        """4.8: from the current rotation speed to the target in `duration`."""
        if self.duration <= 0:
            self.ramp = None
            self.speed_ref = self.final_speed
        else:
            self.ramp = (self.speed, self.final_speed, self.duration, 0.0)

    def _advance_run(self, dt):
        if self.mode == TORQUE_MODE:
            self._follow(self.torque_ref / DRAG, dt, TORQUE_TAU)
            self.speed_ref = self.speed
            return
        if self.ramp:
            begin, end, seconds, elapsed = self.ramp
            elapsed = min(seconds, elapsed + dt)
            self.speed_ref = begin + (end - begin) * elapsed / seconds
            self.ramp = None if elapsed >= seconds else (begin, end, seconds, elapsed)
        self._follow(self.speed_ref, dt, SPEED_TAU)

    def _coast(self, dt):
        self._follow(0.0, dt, COAST_TAU)
        if abs(self.speed) < 0.01:
            self.speed = 0.0

    def _follow(self, target, dt, tau):
        self.speed += (target - self.speed) * (1.0 - math.exp(-dt / tau))

    def _advance_electrics(self, old_speed, dt):
        if self.state == RUN and self.mode == TORQUE_MODE:
            self.iq = float(self.torque_ref)
        elif self.state in (START, RUN):
            gain = DRAG * TORQUE_TAU
            self.iq = DRAG * self.speed + gain * (self.speed - old_speed) / dt
            self.iq = max(-32767.0, min(32767.0, self.iq))
        else:
            self.iq = 0.0
        self.angle += self.speed / 60.0 * 2.0 * math.pi * POLE_PAIRS * dt
        self.angle = (self.angle + math.pi) % (2.0 * math.pi) - math.pi

    # ---- what can be measured -------------------------------------------

    def powered(self):
        """True while there is current in the motor."""
        return self.state in (START, RUN)

    def id(self):
        """Id as measured: it follows its reference at once."""
        return float(self.flux_ref) if self.state == RUN else 0.0

    def flags(self):
        """Past faults in the low half, present ones in the high half (HOLES 9)."""
        return (self.faults_now << 16) | self.faults_past

    def power(self):
        """Mechanical power in W; 0 when the motor brakes (the register is u16)."""
        return max(0.0, self.iq * self.speed * WATTS_PER_S16A_RPM)

    def angle_s16(self):
        """Electrical angle, 32768 = pi."""
        return self.angle / math.pi * 32768.0

    def speed_s16(self):
        """s16speed: 32767 = the maximum application speed (HOLES 21)."""
        return self.speed / self.max_speed * 32767.0

    def vq(self):
        """q voltage: back EMF plus a little resistance."""
        return self.speed_s16() * 0.8 + self.iq * 0.1 if self.powered() else 0.0

    def vd(self):
        """d voltage."""
        return self.id() * 0.1

    def alpha_beta(self, q, d):
        """Inverse Park transform of (q, d) at the present angle."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return q * cos + d * sin, d * cos - q * sin

    def phase_a_b(self):
        """Phase currents a and b (inverse Clarke, ST's axis sense)."""
        alpha, beta = self.alpha_beta(self.iq, self.id())
        return alpha, (-math.sqrt(3.0) * beta - alpha) / 2.0
