//! Power factor correction: a boost converter between mains and bus that raises the bus voltage.
//!
//! It is averaged over a period of the mains, with its input at the mains' effective voltage U and
//! current I (R. W. Erickson and D. Maksimović, *Fundamentals of Power Electronics*, on ideal
//! rectifiers):
//!
//! ```text
//! L dI/dt = u,   U − V_bus ≤ u ≤ U,   I ≥ 0         into the bus: U I / V_bus
//! ```
//!
//! PFC_I_KP, KI and KD make u (s16V) from the current's error (s16A) each period; numerators over
//! 1024, 16384 and 1024. PFC_V_KP, KI and KD make the current's reference (s16A) from the bus
//! voltage's error (V) each millisecond; numerators over 16.

use core::f32::consts::{FRAC_1_SQRT_2, TAU};

use motorlink_proto::st::Flags;

use super::Registers;
use super::scale::{Scale, divisor};
use crate::control::{Gains, Regulator};
use crate::plant::PlantConfig;

/// The boost inductor, H.
const INDUCTANCE: f32 = 1e-3;
/// Bandwidth of the current loop as tuned, rad/s.
const CURRENT_BANDWIDTH: f32 = TAU * 1000.0;
/// Bandwidth of the voltage loop as tuned, rad/s.
const VOLTAGE_BANDWIDTH: f32 = TAU * 10.0;
/// Time between two steps of the voltage loop, s.
const SLOW: f32 = 1e-3;

/// Values of PFC_STATUS. The document does not list them; they are our own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum PfcState {
    /// Off.
    #[default]
    Idle = 0,
    /// Raising the bus voltage for PFC_STARTUP_DURATION.
    StartUp = 1,
    /// Keeping the bus voltage.
    Run = 2,
    /// The cause of a fault is present.
    FaultNow = 3,
    /// The cause of a fault is gone; the fault is not acknowledged yet.
    FaultOver = 4,
}

/// Bits of PFC_FAULTS. The document does not list them; they are our own.
pub mod fault {
    /// The mains are below seven tenths of their nominal voltage.
    pub const MAINS_LOW: u16 = 0x01;
    /// The mains' peak is above the reference of the bus voltage.
    pub const MAINS_HIGH: u16 = 0x02;
    /// The stage's current is 1.5 times its maximum.
    pub const OVER_CURRENT: u16 = 0x04;
    /// The bus voltage is 15 % above its reference.
    pub const BUS_HIGH: u16 = 0x08;
}

/// Gains of both loops per step, in digits.
pub(super) struct PfcGains {
    pub(super) current: Gains,
    pub(super) voltage: Gains,
}

/// The default gains of a board: see the [rules](super::tuning).
pub(super) fn gains(plant: &PlantConfig, scale: &Scale) -> PfcGains {
    let period = f32::from(plant.period_us) * 1e-6;
    let kp = scale.resistance(CURRENT_BANDWIDTH * INDUCTANCE);
    let current = Gains { kp, ki: kp * CURRENT_BANDWIDTH * period / 8.0, kd: 0.0 };
    let bus = Registers::BARE.pfc_dcbus_ref as f32;
    let per_current = scale.nominal * FRAC_1_SQRT_2 / (bus * plant.supply.capacitance);
    let kp = 2.0 * VOLTAGE_BANDWIDTH / per_current * scale.ampere;
    let ki = VOLTAGE_BANDWIDTH * VOLTAGE_BANDWIDTH * SLOW / per_current * scale.ampere;
    PfcGains { current, voltage: Gains { kp, ki, kd: 0.0 } }
}

/// Effective value of mains with this peak, V.
fn effective(peak: f32) -> f32 {
    peak * FRAC_1_SQRT_2
}

#[derive(Debug, Clone)]
pub(super) struct Pfc {
    state: PfcState,
    scale: Scale,
    /// The maximum current, in digits.
    most: f32,
    /// Length of a period, s.
    period: f32,
    gains: Gains,
    current_loop: Regulator,
    voltage_loop: Regulator,
    /// Reference of the current, s16A.
    reference: f32,
    /// A.
    current: f32,
    /// Steps in this state, ms.
    elapsed: u32,
    occurred: u16,
    present: u16,
}

impl Pfc {
    pub(super) fn new(plant: &PlantConfig, scale: Scale, most: f32) -> Self {
        Pfc {
            state: PfcState::Idle,
            scale,
            most: most * scale.ampere,
            period: f32::from(plant.period_us) * 1e-6,
            gains: Gains::default(),
            current_loop: Regulator::default(),
            voltage_loop: Regulator::default(),
            reference: 0.0,
            current: 0.0,
            elapsed: 0,
            occurred: 0,
            present: 0,
        }
    }

    /// One period with the mains' peak and the bus at these voltages: the current into the bus, A.
    pub(super) fn feed(&mut self, mains: f32, bus: f32) -> f32 {
        if !self.enabled() {
            self.current = 0.0;
            return 0.0;
        }
        let mains = effective(mains);
        let error = self.reference - self.current * self.scale.ampere;
        let (least, most) = (mains - bus, mains);
        let volts = 1.0 / self.scale.volt;
        let wish = self.current_loop.step(
            error,
            &self.gains,
            least * self.scale.volt,
            most * self.scale.volt,
        );
        self.current = (self.current + wish * volts * self.period / INDUCTANCE).max(0.0);
        mains * self.current / bus.max(1.0)
    }

    /// One millisecond at a mains peak in V that should be the nominal bus voltage.
    pub(super) fn step(&mut self, mains: f32, bus: f32, registers: &Registers) {
        let nominal = self.scale.nominal;
        self.elapsed = self.elapsed.saturating_add(1);
        self.present = 0;
        if mains < 0.7 * nominal {
            self.present |= fault::MAINS_LOW;
        }
        if mains > registers.pfc_dcbus_ref as f32 {
            self.present |= fault::MAINS_HIGH;
        }
        if self.current * self.scale.ampere > 1.5 * self.most {
            self.present |= fault::OVER_CURRENT;
        }
        if bus > 1.15 * registers.pfc_dcbus_ref as f32 {
            self.present |= fault::BUS_HIGH;
        }
        let startup = u32::try_from(registers.pfc_startup_duration).unwrap_or(0);
        match self.state {
            PfcState::StartUp | PfcState::Run if self.present != 0 => {
                self.enter(PfcState::FaultNow)
            }
            PfcState::StartUp if self.elapsed >= startup => self.enter(PfcState::Run),
            PfcState::FaultNow if self.present == 0 => self.enter(PfcState::FaultOver),
            PfcState::FaultOver if self.present != 0 => self.enter(PfcState::FaultNow),
            _ => {}
        }
        if self.state == PfcState::FaultNow {
            self.occurred |= self.present;
        }
        self.regulate(mains, bus, registers);
    }

    /// Executes one millisecond of the voltage loop. During the start-up the reference rises from
    /// the mains' peak.
    fn regulate(&mut self, mains: f32, bus: f32, registers: &Registers) {
        if !self.enabled() {
            return;
        }
        let last = registers.pfc_dcbus_ref as f32;
        let reference = match self.state {
            PfcState::StartUp => {
                let share = self.elapsed as f32 / registers.pfc_startup_duration.max(1) as f32;
                mains + (last - mains) * share.min(1.0)
            }
            _ => last,
        };
        let divisors = [divisor::PFC_VOLTAGE; 3];
        let numerators = [registers.pfc_v_kp, registers.pfc_v_ki, registers.pfc_v_kd];
        let gains = Gains::new(numerators, divisors);
        self.reference = self.voltage_loop.step(reference - bus, &gains, 0.0, self.most);
        self.gains = Gains::new(
            [registers.pfc_i_kp, registers.pfc_i_ki, registers.pfc_i_kd],
            [divisor::PFC_KP, divisor::PFC_KI, divisor::PFC_KP],
        );
    }

    pub(super) fn enable(&mut self) {
        if self.state == PfcState::Idle {
            self.current_loop = Regulator::default();
            self.voltage_loop = Regulator::default();
            self.reference = 0.0;
            self.enter(PfcState::StartUp);
        }
    }

    pub(super) fn disable(&mut self) {
        if self.enabled() {
            self.enter(PfcState::Idle);
        }
    }

    pub(super) fn acknowledge(&mut self) {
        if self.state == PfcState::FaultOver {
            self.occurred = 0;
            self.enter(PfcState::Idle);
        }
    }

    pub(super) fn enabled(&self) -> bool {
        matches!(self.state, PfcState::StartUp | PfcState::Run)
    }

    pub(super) fn state(&self) -> PfcState {
        self.state
    }

    /// PFC_FAULTS. Only a stage that runs, or that stopped because of a fault, has faults.
    pub(super) fn faults(&self) -> Flags {
        let faulty = self.state == PfcState::FaultNow;
        Flags::new(self.occurred, if faulty { self.present } else { 0 })
    }

    fn enter(&mut self, state: PfcState) {
        self.state = state;
        self.elapsed = 0;
    }
}
