//! A motor with its power stage and firmware.

use motorlink_proto::stmcp::{
    Command, CurrentReference, Flags, PositionMove, REVUP_PHASES, Ramp, RevupPhase, Status,
    TorqueRamp,
};

use super::control::{Control, Feedback, RPM, step_to};
use super::pfc::Pfc;
use super::state::{self, Situation};
use super::{MotorConfig, Registers};
use crate::heat::Heat;
use crate::machine::{Machine, within};

/// Length of a step, s.
const DT: f32 = 1e-3;
/// Share of the way to its reference that a current goes in a step: a lag of 1 ms.
const CURRENT_LAG: f32 = 0.632;
/// Time in which a rotor follows a forced field, s.
const PULL: f32 = 5e-3;
/// Rate at which the alignment turns the rotor to where it belongs, 1/s.
const ALIGNMENT_RATE: f32 = 20.0;
/// Speed below which the rotor stands, rpm.
const STANDING: f32 = 1.0;
/// How long a rotor may be stuck in RUN, ms.
const STALL: u32 = 500;

/// A motor of an ST drive.
#[derive(Debug, Clone)]
pub struct StMotor {
    pub(super) config: MotorConfig,
    pub(super) machine: Machine,
    pub(super) heat: Heat,
    /// Voltage of the bus without PFC, V.
    pub(super) supply: f32,
    /// Faults that something outside holds.
    pub(super) held: u16,
    pub(super) firmware: Firmware,
}

/// What a power cycle sets back.
#[derive(Debug, Clone)]
pub(super) struct Firmware {
    pub(super) status: Status,
    /// Steps in this state, ms.
    elapsed: u32,
    /// Faults that happened since the last step.
    pub(super) events: u16,
    occurred: u16,
    present: u16,
    pub(super) registers: Registers,
    pub(super) revup: [RevupPhase; REVUP_PHASES as usize],
    pub(super) control: Control,
    pub(super) pfc: Pfc,
    /// Iq and Id, A.
    pub(super) iq: f32,
    pub(super) id: f32,
    aligned: bool,
    starting: bool,
    /// Position that the alignment made zero.
    pub(super) zero: i64,
    stalled: u32,
}

impl Firmware {
    pub(super) fn new(config: &MotorConfig) -> Self {
        let limiter = config.durations.inrush_ms > 0;
        Firmware {
            status: if limiter { Status::IclWait } else { Status::Idle },
            elapsed: 0,
            events: 0,
            occurred: 0,
            present: 0,
            registers: config.registers,
            revup: config.revup_phases(),
            control: Control::new(config),
            pfc: Pfc::default(),
            iq: 0.0,
            id: 0.0,
            aligned: false,
            starting: false,
            zero: 0,
            stalled: 0,
        }
    }

    fn enter(&mut self, status: Status) {
        self.status = status;
        self.elapsed = 0;
    }
}

/// What the host commands.
impl StMotor {
    pub(super) fn execute(&mut self, command: Command) {
        let status = self.firmware.status;
        match command {
            Command::StartMotor => self.start(),
            Command::StopMotor => self.stop(),
            Command::StartStop if status == Status::Idle => self.start(),
            Command::StartStop => self.stop(),
            Command::StopRamp => self.firmware.control.stop_ramp(),
            Command::FaultAck if status == Status::FaultOver && self.firmware.events == 0 => {
                self.firmware.occurred = 0;
                self.firmware.enter(Status::StopIdle);
            }
            Command::EncoderAlign
                if status == Status::Idle && self.config.build.position_sensor =>
            {
                self.firmware.starting = false;
                self.firmware.enter(Status::IdleAlignment);
            }
            Command::IqdrefClear => {
                self.firmware.registers.iq_speedmode = self.config.registers.iq_speedmode;
                if self.firmware.control.commanded_currents().is_some() {
                    self.torque(step_to(0), 0);
                }
            }
            Command::PfcEnable => self.firmware.pfc.enable(),
            Command::PfcDisable => self.firmware.pfc.disable(),
            Command::PfcFaultAck => self.firmware.pfc.acknowledge(),
            _ => {}
        }
    }

    fn start(&mut self) {
        if self.firmware.status == Status::Idle {
            self.firmware.starting = true;
            self.firmware.enter(Status::IdleStart);
        }
    }

    fn stop(&mut self) {
        if state::stoppable(self.firmware.status) {
            self.firmware.enter(Status::AnyStop);
        }
    }

    pub(super) fn ramp(&mut self, ramp: Ramp) {
        self.firmware.control.command_speed(ramp);
        self.obey();
    }

    pub(super) fn torque(&mut self, ramp: TorqueRamp, id: i16) {
        self.firmware.control.command_torque(ramp, id);
        self.obey();
    }

    pub(super) fn currents(&mut self, CurrentReference { iq_s16a, id_s16a }: CurrentReference) {
        self.torque(step_to(iq_s16a.into()), id_s16a);
    }

    /// An angle that is no number is not gone to.
    pub(super) fn position(&mut self, target: PositionMove) {
        if target.angle_rad.is_finite() {
            self.firmware.control.command_position(target);
            self.obey();
        }
    }

    fn obey(&mut self) {
        if self.running() {
            let position = self.position_from_zero();
            self.firmware.control.execute(self.firmware.registers.max_app_speed, position);
        }
    }
}

/// What happens by itself.
impl StMotor {
    /// One millisecond.
    pub(super) fn step(&mut self) {
        self.watch();
        self.proceed();
        let torque = self.drive();
        self.machine.step(DT, torque);
        let loss = self.config.machine.copper_loss(self.firmware.iq, self.firmware.id);
        self.heat.step(DT, loss);
        if self.config.build.pfc {
            let Firmware { pfc, registers, .. } = &mut self.firmware;
            pfc.step(self.supply, self.config.bus_voltage, registers);
        }
    }

    /// Looks for the causes of faults; a new one switches the motor off.
    fn watch(&mut self) {
        let limits = self.config.thresholds;
        let (voltage, temperature) = (self.bus_voltage(), self.heat.temperature());
        let hot = self.firmware.present & Flags::OVER_TEMP != 0;
        let cool_down = if hot { limits.temperature_hysteresis } else { 0.0 };
        let causes = [
            (Flags::OVER_VOLT, voltage > limits.over_voltage),
            (Flags::UNDER_VOLT, voltage < limits.under_voltage),
            (Flags::OVER_TEMP, temperature > limits.over_temperature - cool_down),
            (Flags::SPEED_FDBK, self.feedback_lost()),
        ];
        let events = core::mem::take(&mut self.firmware.events);
        let present = causes
            .iter()
            .filter(|(_, present)| *present)
            .fold(self.held | events, |all, (fault, _)| all | fault);
        self.firmware.present = present;
        self.firmware.occurred |= present;
        let status = self.firmware.status;
        if present != 0 && !matches!(status, Status::FaultNow | Status::FaultOver) {
            self.firmware.enter(Status::FaultNow);
        }
    }

    /// Whether the rotor is not where the firmware believes.
    fn feedback_lost(&mut self) -> bool {
        let speed = self.speed_rpm().abs();
        let most = self.firmware.registers.max_app_speed as f32;
        let least = self.firmware.registers.min_app_speed as f32;
        let pushed = self.firmware.iq.abs() >= 0.2 * self.config.rated_current;
        let moving = self.firmware.control.path().is_some();
        let stuck = pushed && !moving && speed <= STANDING.max(0.25 * least);
        self.firmware.stalled = if self.running() && stuck { self.firmware.stalled + 1 } else { 0 };
        self.running() && (speed > 1.2 * most || self.firmware.stalled >= STALL)
    }

    fn proceed(&mut self) {
        self.firmware.elapsed = self.firmware.elapsed.saturating_add(1);
        let sensor = self.config.build.position_sensor;
        let situation = Situation {
            elapsed: self.firmware.elapsed,
            durations: &self.config.durations,
            revup: &self.firmware.revup,
            sensor,
            unaligned: sensor && !self.firmware.aligned,
            starting: self.firmware.starting,
            standing: self.speed_rpm().abs() < STANDING,
            faulty: self.firmware.present != 0,
        };
        let Some(next) = state::next(self.firmware.status, &situation) else { return };
        match (self.firmware.status, next) {
            (Status::Alignment, _) => {
                self.firmware.aligned = true;
                self.firmware.zero = self.machine.position();
            }
            (Status::Start, Status::SwitchOver) if !self.rotor_found() => {
                self.firmware.events |= Flags::START_UP;
                return;
            }
            _ => {}
        }
        self.firmware.enter(next);
        self.obey();
    }

    /// Whether the observer can take over at the end of the rev-up.
    fn rotor_found(&self) -> bool {
        let (forced, _) = self.forced();
        let least = self.firmware.registers.min_app_speed as f32;
        forced.abs() >= least && self.speed_rpm() / forced >= 0.8
    }

    /// Speed (rpm) and current (A) that the rev-up forces now.
    fn forced(&self) -> (f32, f32) {
        let elapsed = match self.firmware.status {
            Status::Start => self.firmware.elapsed,
            _ => u32::MAX,
        };
        let (speed, digits) = state::revup(&self.firmware.revup, elapsed);
        let sign = if self.firmware.control.backwards() { -1.0 } else { 1.0 };
        (sign * speed, sign * self.config.amperes(digits))
    }

    /// Drives currents for a step; the torque that they make, Nm.
    fn drive(&mut self) -> f32 {
        let sensor = self.config.build.position_sensor;
        match self.firmware.status {
            Status::Run => self.regulate(),
            Status::Start | Status::SwitchOver | Status::StartRun if !sensor => {
                let (speed, current) = self.forced();
                self.lag(current, 0.0);
                self.pull(speed / RPM, self.firmware.iq)
            }
            Status::Alignment => {
                self.lag(0.0, self.config.alignment_current);
                let away = f32::from(self.machine.electrical_angle() as i16) / 65536.0;
                let turns = -away / f32::from(self.config.machine.pole_pairs);
                let speed = turns * core::f32::consts::TAU * ALIGNMENT_RATE;
                self.pull(speed, self.firmware.id)
            }
            _ => {
                (self.firmware.iq, self.firmware.id) = (0.0, 0.0);
                self.firmware.control.follow(0.0, 0.0);
                0.0
            }
        }
    }

    /// A field that turns at `speed` (rad/s) pulls the rotor along as far as `current` (A) can.
    fn pull(&mut self, speed: f32, current: f32) -> f32 {
        let most = (self.config.machine.torque_constant * current).abs();
        let wanted = self.config.machine.inertia * (speed - self.machine.speed()) / PULL;
        let torque = within(wanted, -most, most);
        let iq = self.config.digits(torque / self.config.machine.torque_constant);
        self.firmware.control.follow(speed * RPM, iq as f32);
        torque
    }

    fn regulate(&mut self) -> f32 {
        let feedback = Feedback {
            speed_rpm: self.speed_rpm(),
            position: self.position_from_zero(),
            iq_range: self.iq_range(),
        };
        let Firmware { control, registers, .. } = &mut self.firmware;
        let iq = control.step(&feedback, registers);
        let rated = self.config.rated_current;
        let id = within(self.config.amperes(self.flux_reference() as f32), -rated, rated);
        self.lag(self.config.amperes(iq), id);
        self.config.machine.torque_constant * self.firmware.iq
    }

    /// Iq that the rating allows and the bus voltage can drive, s16A.
    fn iq_range(&self) -> (f32, f32) {
        let voltage = self.phase_voltage();
        let possible = |voltage: f32| {
            let rated = self.config.rated_current;
            let current = (voltage - self.machine.back_emf()) / self.config.machine.resistance;
            within(current, -rated, rated) * (32767.0 / self.config.full_scale_current)
        };
        (possible(-voltage), possible(voltage))
    }

    fn lag(&mut self, iq: f32, id: f32) {
        self.firmware.iq += (iq - self.firmware.iq) * CURRENT_LAG;
        self.firmware.id += (id - self.firmware.id) * CURRENT_LAG;
    }

    pub(super) fn running(&self) -> bool {
        self.firmware.status == Status::Run
    }

    pub(super) fn flags(&self) -> Flags {
        Flags::new(self.firmware.occurred, self.firmware.present)
    }

    pub(super) fn speed_rpm(&self) -> f32 {
        self.machine.speed() * RPM
    }

    pub(super) fn position_from_zero(&self) -> i64 {
        self.machine.position().wrapping_sub(self.firmware.zero)
    }

    pub(super) fn bus_voltage(&self) -> f32 {
        self.firmware.pfc.bus_voltage(self.supply, &self.firmware.registers).max(0.0)
    }

    /// The greatest phase voltage, V.
    pub(super) fn phase_voltage(&self) -> f32 {
        const INVERSE_SQRT_3: f32 = 0.577_350_3;
        self.bus_voltage() * INVERSE_SQRT_3
    }
}
