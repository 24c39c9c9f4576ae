//! Registers: what a host reads and writes.

use motorlink_proto::stmcp::register::Value;
use motorlink_proto::stmcp::{
    ControlMode, CurrentReference, ErrorCode, REVUP_PHASES, Ramp, RegisterId, Status,
};

use super::StMotor;
use super::control::RPM_PER_DIGIT;
use crate::machine;
use crate::transform::{phases, stator};

/// Mains frequency, 0.1 Hz.
const MAINS_FREQUENCY: i32 = 500;

/// The nearest s16 digits to a value of which `full_scale` is 32767 digits; saturates.
pub(super) fn s16(value: f32, full_scale: f32) -> i32 {
    i32::from(libm::roundf(value / full_scale * 32767.0) as i16)
}

/// The nearest whole number.
fn whole(value: f32) -> i32 {
    libm::roundf(value) as i32
}

/// Voltages in the rotor's frame, V.
struct Voltages {
    d: f32,
    q: f32,
}

impl StMotor {
    /// The value of a register, also of one that this build does not have.
    pub fn read(&self, register: RegisterId) -> i32 {
        use RegisterId as R;
        let firmware = &self.firmware;
        if let Some(value) = firmware.registers.get(register) {
            return value;
        }
        let (iq, id) = (self.config.digits(firmware.iq), self.config.digits(firmware.id));
        match register {
            R::FLAGS => self.flags().0 as i32,
            R::STATUS => u8::from(firmware.status).into(),
            R::CONTROL_MODE => u8::from(firmware.control.mode()).into(),
            R::SPEED_REF => whole(firmware.control.speed_reference()),
            R::SPEED_MEAS => whole(self.speed_rpm()),
            R::RAMP_FINAL_SPEED => firmware.control.ramp().speed_rpm,
            R::RAMP_DURATION => firmware.control.ramp().duration_ms.into(),
            R::TORQUE_REF | R::I_Q_REF => self.torque_reference(),
            R::FLUX_REF | R::I_D_REF => self.flux_reference(),
            R::TORQUE_MEAS | R::I_Q => iq,
            R::FLUX_MEAS | R::I_D => id,
            R::BUS_VOLTAGE => whole(self.bus_voltage()),
            R::HEATS_TEMP => whole(self.heat.temperature()),
            R::MOTOR_POWER => whole(self.power()),
            R::RUC_STAGE_NBR => REVUP_PHASES.into(),
            R::PFC_STATUS => firmware.pfc.state() as i32,
            R::PFC_FAULTS => firmware.pfc.faults().0 as i32,
            R::PFC_DCBUS_MEAS => whole(self.bus_voltage()),
            R::PFC_ACBUS_FREQ => MAINS_FREQUENCY,
            R::PFC_ACBUS_RMS => whole(self.supply),
            R::PFC_ENABLED => firmware.pfc.enabled().into(),
            R::CURRENT_POSITION => machine::radians(self.position_from_zero()).bits(),
            R::TARGET_POSITION => firmware.control.path().map_or(0.0, |path| path.target()).bits(),
            R::MOVE_DURATION => firmware.control.path().map_or(0.0, |path| path.duration()).bits(),
            _ => self.signal(register),
        }
    }

    /// Signals of the current loop, mostly of access D; 0 for what a motor without them has.
    fn signal(&self, register: RegisterId) -> i32 {
        use RegisterId as R;
        let full = self.phase_voltage();
        let volts = |value| s16(value, full);
        let angle = self.machine.electrical_angle();
        let current = |at: usize| {
            let (alpha, beta) = stator(self.firmware.id, self.firmware.iq, angle);
            let (a, b) = phases((alpha, beta));
            self.config.digits([a, b, alpha, beta][at])
        };
        let emf = || stator(0.0, if self.powered() { self.machine.back_emf() } else { 0.0 }, angle);
        let voltage = || {
            let Voltages { d, q } = self.voltages();
            stator(d, q, angle)
        };
        let speed = whole(self.speed_rpm() / RPM_PER_DIGIT);
        match register {
            R::I_A => current(0),
            R::I_B => current(1),
            R::I_ALPHA => current(2),
            R::I_BETA => current(3),
            R::V_Q => volts(self.voltages().q),
            R::V_D => volts(self.voltages().d),
            R::V_ALPHA => volts(voltage().0),
            R::V_BETA => volts(voltage().1),
            R::MEAS_EL_ANGLE => i32::from(angle as i16),
            R::MEAS_ROT_SPEED => speed,
            R::FLUXWK_BUS_MEAS => self.voltage_share(),
            R::FF_VQ => self.feed_forward().1,
            R::FF_VD => self.feed_forward().0,
            R::FF_VQ_PIOUT => volts(self.voltages().q) - self.feed_forward().1,
            R::FF_VD_PIOUT => volts(self.voltages().d) - self.feed_forward().0,
            // An observer sees nothing of a motor that is not driven.
            _ if !self.powered() => 0,
            R::OBS_EL_ANGLE | R::OBS_CR_EL_ANGLE => i32::from(angle as i16),
            R::OBS_ROT_SPEED | R::OBS_CR_ROT_SPEED => speed,
            R::OBS_I_ALPHA | R::OBS_CR_I_ALPHA => current(2),
            R::OBS_I_BETA | R::OBS_CR_I_BETA => current(3),
            R::OBS_BEMF_ALPHA | R::OBS_CR_BEMF_ALPHA => volts(emf().0),
            R::OBS_BEMF_BETA | R::OBS_CR_BEMF_BETA => volts(emf().1),
            R::EST_BEMF_LEVEL | R::OBS_BEMF_LEVEL | R::EST_CR_BEMF_LEVEL | R::OBS_CR_BEMF_LEVEL => {
                let level = volts(self.machine.back_emf());
                level * level / 32768
            }
            _ => 0,
        }
    }

    /// Writes a register that may be written.
    pub(super) fn write(&mut self, register: RegisterId, value: i32) -> Result<(), ErrorCode> {
        let present = CurrentReference {
            iq_s16a: self.torque_reference() as i16,
            id_s16a: self.flux_reference() as i16,
        };
        match register {
            RegisterId::CONTROL_MODE => {
                self.firmware.control.set_mode(ControlMode::from(value as u8));
            }
            RegisterId::TORQUE_REF => {
                self.currents(CurrentReference { iq_s16a: value as i16, ..present });
            }
            RegisterId::FLUX_REF => {
                self.currents(CurrentReference { id_s16a: value as i16, ..present });
            }
            RegisterId::RAMP_FINAL_SPEED => {
                let last = self.firmware.control.ramp();
                self.ramp(Ramp { speed_rpm: value, ..last });
            }
            _ => {
                let slot = self.firmware.registers.slot(register);
                *slot.ok_or(ErrorCode::SetReadOnly)? = value;
            }
        }
        Ok(())
    }

    /// What a DAC channel, 1 or 2, shows: the value of the register that was chosen.
    pub fn dac(&self, channel: u8) -> i32 {
        let chosen = if channel == 2 { RegisterId::DAC_OUT2 } else { RegisterId::DAC_OUT1 };
        self.read(RegisterId(self.read(chosen) as u8))
    }

    /// Iq reference, s16A: before a start what it will be.
    fn torque_reference(&self) -> i32 {
        let control = &self.firmware.control;
        if self.running() {
            return control.iq_reference();
        }
        if self.powered() {
            return self.config.digits(self.firmware.iq);
        }
        control.commanded_currents().map_or(0, |currents| currents.iq_s16a.into())
    }

    /// Id reference, s16A: of torque mode, or of speed mode.
    pub(super) fn flux_reference(&self) -> i32 {
        match self.firmware.control.commanded_currents() {
            Some(currents) => currents.id_s16a.into(),
            None => self.firmware.registers.iq_speedmode,
        }
    }

    /// Whether the power stage drives current.
    fn powered(&self) -> bool {
        use Status::{Alignment, Run, Start, StartRun, SwitchOver};
        matches!(self.firmware.status, Start | SwitchOver | StartRun | Run | Alignment)
    }

    /// What the power stage applies so that the currents flow.
    fn voltages(&self) -> Voltages {
        if !self.powered() {
            return Voltages { d: 0.0, q: 0.0 };
        }
        let machine = &self.config.machine;
        let (iq, id) = (self.firmware.iq, self.firmware.id);
        let reactance = self.machine.speed() * f32::from(machine.pole_pairs) * machine.inductance;
        Voltages {
            d: machine.resistance * id - reactance * iq,
            q: machine.resistance * iq + reactance * id + self.machine.back_emf(),
        }
    }

    /// Electrical power into the motor, W.
    fn power(&self) -> f32 {
        let Voltages { d, q } = self.voltages();
        1.5 * (q * self.firmware.iq + d * self.firmware.id)
    }

    /// Share of the bus voltage in use, 0.1 %.
    fn voltage_share(&self) -> i32 {
        let Voltages { d, q } = self.voltages();
        whole(libm::hypotf(d, q) / self.phase_voltage() * 1000.0).min(1000)
    }

    /// Feed-forward parts of Vd and Vq, s16V.
    fn feed_forward(&self) -> (i32, i32) {
        if !self.powered() {
            return (0, 0);
        }
        let registers = &self.firmware.registers;
        let speed = self.speed_rpm() / RPM_PER_DIGIT / 1024.0;
        let share = |current| self.config.digits(current) as f32 / 32768.0;
        let d = -speed * registers.ff_1d as f32 * share(self.firmware.iq);
        let q = speed * (registers.ff_2 as f32 + registers.ff_1q as f32 * share(self.firmware.id));
        (i32::from(d as i16), i32::from(q as i16))
    }
}
