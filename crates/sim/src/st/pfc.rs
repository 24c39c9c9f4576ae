//! Power factor correction: a stage between mains and bus that raises the bus voltage.

use motorlink_proto::stmcp::Flags;

use super::Registers;

/// Values of PFC_STATUS. The document does not list them; these are ours.
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
    /// A fault's cause is gone; it waits to be acknowledged.
    FaultOver = 4,
}

/// Bits of PFC_FAULTS. The document does not list them; these are ours.
pub mod fault {
    /// The mains are below seven tenths of what they should be.
    pub const MAINS_LOW: u16 = 0x01;
    /// The mains' peak is above the bus voltage to keep.
    pub const MAINS_HIGH: u16 = 0x02;
}

#[derive(Debug, Clone, Default)]
pub(super) struct Pfc {
    state: PfcState,
    /// Steps in this state, ms.
    elapsed: u32,
    occurred: u16,
    present: u16,
}

impl Pfc {
    /// One millisecond at a mains peak in V that should be `nominal`.
    pub(super) fn step(&mut self, mains: f32, nominal: f32, registers: &Registers) {
        self.elapsed = self.elapsed.saturating_add(1);
        self.present = 0;
        if mains < 0.7 * nominal {
            self.present |= fault::MAINS_LOW;
        }
        if mains > registers.pfc_dcbus_ref as f32 {
            self.present |= fault::MAINS_HIGH;
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
    }

    /// The voltage that the bus has with the stage in front of it, V.
    pub(super) fn bus_voltage(&self, mains: f32, registers: &Registers) -> f32 {
        let reference = registers.pfc_dcbus_ref as f32;
        match self.state {
            PfcState::StartUp => {
                let share = self.elapsed as f32 / registers.pfc_startup_duration.max(1) as f32;
                mains + (reference - mains) * share.min(1.0)
            }
            PfcState::Run => reference,
            _ => mains,
        }
    }

    pub(super) fn enable(&mut self) {
        if self.state == PfcState::Idle {
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

    /// PFC_FAULTS: only a stage that runs, or stopped for it, has faults.
    pub(super) fn faults(&self) -> Flags {
        let faulty = self.state == PfcState::FaultNow;
        Flags::new(self.occurred, if faulty { self.present } else { 0 })
    }

    fn enter(&mut self, state: PfcState) {
        self.state = state;
        self.elapsed = 0;
    }
}
