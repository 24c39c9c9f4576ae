//! A motor with its power stage and firmware.

use motorlink_proto::st::{
    Command, CurrentReference, Flags, PositionMove, REVUP_PHASES, Ramp, RevupPhase, Status,
    TorqueRamp,
};

use super::control::{Control, step_to};
use super::encoder::Tracker;
use super::foc::Foc;
use super::observer::{Observer, Tracking};
use super::pfc::Pfc;
use super::scale::Scale;
use super::{MotorConfig, Registers, state};
use crate::control::Regulator;
use crate::plant::{Bridge, Plant};
use crate::vector::Vector;

/// Time between two steps of the slow loops, µs.
const SLOW_US: u32 = 1000;

/// A motor of an ST drive.
#[derive(Debug, Clone)]
pub struct StMotor {
    pub(super) config: MotorConfig,
    pub(super) plant: Plant,
    /// Faults that are held from outside.
    pub(super) held: u16,
    pub(super) firmware: Firmware,
    /// Elapsed time of less than a period, µs.
    pub(super) rest_us: u64,
}

/// The source of the current control's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Frame {
    /// None: the bridge is off.
    Off,
    /// A forced frame, independent of the rotor.
    Forced,
    /// The encoder.
    Encoder,
    /// The observer.
    Observed,
}

/// The state that a power cycle resets.
#[derive(Debug, Clone)]
pub(super) struct Firmware {
    pub(super) status: Status,
    /// Steps in this state, ms.
    pub(super) elapsed: u32,
    /// Faults since the last step.
    pub(super) events: u16,
    pub(super) occurred: u16,
    pub(super) present: u16,
    pub(super) registers: Registers,
    pub(super) revup: [RevupPhase; REVUP_PHASES as usize],
    pub(super) control: Control,
    pub(super) pfc: Pfc,
    pub(super) scale: Scale,
    pub(super) foc: Foc,
    pub(super) pll: Option<Observer>,
    pub(super) cordic: Option<Observer>,
    pub(super) tracker: Tracker,
    pub(super) frame: Frame,
    /// Electrical angle of the forced frame, 2^32 a turn, and its change per period.
    pub(super) forced: u32,
    pub(super) forced_step: i32,
    /// Samples of both currents without current: sums, number, and the resulting offsets.
    pub(super) offset_sum: Vector,
    pub(super) offset_count: u32,
    pub(super) offset: Vector,
    /// Measured speed, rad/s.
    pub(super) speed: f32,
    /// Electrical power into the motor, W.
    pub(super) power: f32,
    pub(super) weakening: Regulator,
    pub(super) aligned: bool,
    pub(super) starting: bool,
    /// Encoder position of the aligned zero, 2^32 a turn.
    pub(super) zero: i64,
    /// Time for which the rotor was stuck, and was or was not detected by the observer, ms.
    pub(super) stalled: u32,
    pub(super) seen: u32,
    pub(super) unseen: u32,
    since_slow_us: u32,
}

impl Firmware {
    pub(super) fn new(config: &MotorConfig, plant: &Plant) -> Self {
        let scale = Scale::new(&config.plant);
        let limiter = config.durations.inrush_ms > 0;
        let build = &config.build;
        let observer = |tracking| Observer::new(tracking, &config.plant, &scale);
        // A build without position sensor has an observer, even if its registers do not exist.
        let pll = build.observer_pll || !(build.observer_cordic || build.position_sensor);
        Firmware {
            status: if limiter { Status::IclWait } else { Status::Idle },
            elapsed: 0,
            events: 0,
            occurred: 0,
            present: 0,
            registers: config.registers,
            revup: config.revup_phases(&scale),
            control: Control::new(config),
            pfc: Pfc::new(&config.plant, scale, config.pfc_current),
            foc: Foc::new(&config.plant, &scale),
            pll: pll.then(|| observer(Tracking::Pll)),
            cordic: build.observer_cordic.then(|| observer(Tracking::Cordic)),
            scale,
            tracker: Tracker::new(plant.counts() << plant.finer_bits()),
            frame: Frame::Off,
            forced: 0,
            forced_step: 0,
            offset_sum: Vector::ZERO,
            offset_count: 0,
            offset: Vector::ZERO,
            speed: 0.0,
            power: 0.0,
            weakening: Regulator::default(),
            aligned: false,
            starting: false,
            zero: 0,
            stalled: 0,
            seen: 0,
            unseen: 0,
            since_slow_us: 0,
        }
    }

    /// Enters a state, and sets the bridge accordingly.
    pub(super) fn enter(&mut self, status: Status, sensor: bool) {
        self.status = status;
        self.elapsed = 0;
        let last = self.frame;
        self.frame = match status {
            Status::Start | Status::StartRun | Status::Run if sensor => Frame::Encoder,
            Status::Alignment | Status::Start => Frame::Forced,
            Status::SwitchOver | Status::StartRun | Status::Run => Frame::Observed,
            _ => Frame::Off,
        };
        match (last, self.frame) {
            (Frame::Off, Frame::Off) => {}
            (_, Frame::Off) => self.foc.stop(),
            (Frame::Off, _) => self.begin(),
            _ => {}
        }
        if matches!(status, Status::OffsetCalib | Status::AlignOffsetCalib) {
            (self.offset_sum, self.offset_count) = (Vector::ZERO, 0);
        }
    }

    /// Starts the current control.
    fn begin(&mut self) {
        self.foc.begin();
        self.weakening = Regulator::default();
        (self.forced, self.forced_step) = (0, 0);
        (self.stalled, self.seen, self.unseen) = (0, 0, 0);
        let backwards = self.control.backwards();
        for observer in [&mut self.pll, &mut self.cordic].into_iter().flatten() {
            observer.begin(backwards);
        }
    }

    /// The observer that the drive uses.
    pub(super) fn observer(&self) -> Option<&Observer> {
        self.pll.as_ref().or(self.cordic.as_ref())
    }
}

/// The host's commands.
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
                self.enter(Status::StopIdle);
            }
            Command::EncoderAlign
                if status == Status::Idle && self.config.build.position_sensor =>
            {
                self.firmware.starting = false;
                self.enter(Status::IdleAlignment);
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
            self.enter(Status::IdleStart);
        }
    }

    fn stop(&mut self) {
        if state::stoppable(self.firmware.status) {
            self.enter(Status::AnyStop);
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

    /// An angle that is NaN or infinite is ignored.
    pub(super) fn position(&mut self, target: PositionMove) {
        if target.angle_rad.is_finite() {
            self.firmware.control.command_position(target);
            self.obey();
        }
    }

    pub(super) fn obey(&mut self) {
        if self.running() {
            let position = self.position_from_zero();
            self.firmware.control.execute(self.firmware.registers.max_app_speed, position);
        }
    }
}

/// The simulation of a period.
impl StMotor {
    /// Simulates for a time, µs.
    pub(super) fn advance(&mut self, us: u64) {
        let period = u64::from(self.config.plant.period_us);
        self.rest_us += us;
        while self.rest_us >= period {
            self.rest_us -= period;
            self.period();
        }
    }

    fn period(&mut self) {
        let bridge = match self.firmware.frame {
            Frame::Off => {
                self.sample_offsets();
                Bridge::Off
            }
            frame => self.control_currents(frame),
        };
        if self.firmware.pfc.enabled() {
            let (mains, bus) = (self.plant.supply().voltage, self.plant.bus_voltage());
            self.plant.feed(self.firmware.pfc.feed(mains, bus));
        }
        self.plant.step(bridge);
        if bridge != Bridge::Off {
            self.compare_currents();
        }
        self.firmware.since_slow_us += u32::from(self.config.plant.period_us);
        if self.firmware.since_slow_us >= SLOW_US {
            self.firmware.since_slow_us = 0;
            self.millisecond();
        }
    }

    /// Samples the currents without current while the sensors are calibrated.
    fn sample_offsets(&mut self) {
        let firmware = &mut self.firmware;
        if matches!(firmware.status, Status::OffsetCalib | Status::AlignOffsetCalib) {
            let sample = self.plant.sample();
            let sample = Vector::new(sample.a.into(), sample.b.into());
            firmware.offset_sum = firmware.offset_sum + sample;
            firmware.offset_count += 1;
        }
    }

    #[inline]
    fn control_currents(&mut self, frame: Frame) -> Bridge {
        let firmware = &mut self.firmware;
        let sample = self.plant.sample();
        let (a, b) = (f32::from(sample.a), f32::from(sample.b));
        let current = Vector::from_phases(a - firmware.offset.x, b - firmware.offset.y);
        let acting = firmware.foc.acting();
        for observer in [&mut firmware.cordic, &mut firmware.pll].into_iter().flatten() {
            observer.step(current, acting);
        }
        let rotor = match frame {
            Frame::Observed => firmware.observer().map_or(Vector::ZERO, Observer::frame),
            Frame::Encoder => {
                let counts = self.plant.counts() << self.plant.finer_bits();
                let position = counts.wrapping_sub(firmware.zero) as u32;
                let pairs = u32::from(self.config.plant.machine.pole_pairs);
                Vector::unit(position.wrapping_mul(pairs))
            }
            Frame::Forced | Frame::Off => {
                firmware.forced = firmware.forced.wrapping_add(firmware.forced_step as u32);
                Vector::unit(firmware.forced)
            }
        };
        firmware.foc.step(current, rotor)
    }

    /// The comparator: switches the bridge off if a phase's current is too high.
    #[inline]
    fn compare_currents(&mut self) {
        let most = self.config.thresholds.over_current;
        let current = self.plant.machine().current();
        if current.square() > most * most && current.phases().iter().any(|phase| phase.abs() > most)
        {
            self.firmware.events |= Flags::BREAK_IN;
            self.firmware.occurred |= Flags::BREAK_IN;
            self.firmware.present |= Flags::BREAK_IN;
            self.enter(Status::FaultNow);
        }
    }

    pub(super) fn enter(&mut self, status: Status) {
        self.firmware.enter(status, self.config.build.position_sensor);
        if self.firmware.frame == Frame::Off {
            self.plant.open_bridge();
        }
    }
}
