//! Reads and writes of registers by a host.

use motorlink_proto::st::register::Value;
use motorlink_proto::st::{
    ControlMode, CurrentReference, ErrorCode, REVUP_PHASES, Ramp, RegisterId,
};

use super::StMotor;
use super::motor::Frame;
use super::observer::Observer;
use super::scale::{FULL, SPEED, s16};
use crate::angle;

/// Mains frequency, 0.1 Hz.
const MAINS_FREQUENCY: i32 = 500;

/// The nearest whole number.
fn whole(value: f32) -> i32 {
    libm::roundf(value) as i32
}

impl StMotor {
    /// The value of a register, also of one that does not exist in this build.
    pub fn read(&self, register: RegisterId) -> i32 {
        use RegisterId as R;
        let firmware = &self.firmware;
        if let Some(value) = firmware.registers.get(register) {
            return value;
        }
        let foc = &firmware.foc;
        match register {
            R::FLAGS => self.flags().0 as i32,
            R::STATUS => u8::from(firmware.status).into(),
            R::CONTROL_MODE => u8::from(firmware.control.requested_mode()).into(),
            R::SPEED_REF => whole(firmware.control.speed_reference()),
            R::SPEED_MEAS => whole(self.speed_rpm()),
            R::RAMP_FINAL_SPEED => firmware.control.ramp().speed_rpm,
            R::RAMP_DURATION => firmware.control.ramp().duration_ms.into(),
            R::TORQUE_REF => self.torque_reference(),
            R::FLUX_REF => self.flux_reference(),
            R::I_Q_REF => s16(foc.reference.y),
            R::I_D_REF => s16(foc.reference.x),
            R::TORQUE_MEAS | R::I_Q => s16(foc.current.y),
            R::FLUX_MEAS | R::I_D => s16(foc.current.x),
            R::BUS_VOLTAGE => whole(self.plant.bus_voltage()),
            R::HEATS_TEMP => whole(self.plant.temperature()),
            R::MOTOR_POWER => whole(firmware.power),
            R::RUC_STAGE_NBR => REVUP_PHASES.into(),
            R::PFC_STATUS => firmware.pfc.state() as i32,
            R::PFC_FAULTS => firmware.pfc.faults().0 as i32,
            R::PFC_DCBUS_MEAS => whole(self.plant.bus_voltage()),
            R::PFC_ACBUS_FREQ => MAINS_FREQUENCY,
            R::PFC_ACBUS_RMS => whole(self.plant.supply().voltage),
            R::PFC_ENABLED => firmware.pfc.enabled().into(),
            R::CURRENT_POSITION => angle::radians(self.position_from_zero()).bits(),
            R::TARGET_POSITION => firmware.control.path().map_or(0.0, |path| path.target()).bits(),
            R::MOVE_DURATION => firmware.control.path().map_or(0.0, |path| path.duration()).bits(),
            _ => self.signal(register),
        }
    }

    /// Signals of the current loop, mostly of access D; 0 if the motor does not have them.
    fn signal(&self, register: RegisterId) -> i32 {
        use RegisterId as R;
        let firmware = &self.firmware;
        let foc = &firmware.foc;
        let [a, b, _] = foc.stator_current.phases();
        let forward = foc.voltage - foc.regulated;
        match register {
            R::I_A => s16(a),
            R::I_B => s16(b),
            R::I_ALPHA => s16(foc.stator_current.x),
            R::I_BETA => s16(foc.stator_current.y),
            R::V_Q => s16(foc.voltage.y),
            R::V_D => s16(foc.voltage.x),
            R::V_ALPHA => s16(foc.stator_voltage.x),
            R::V_BETA => s16(foc.stator_voltage.y),
            R::MEAS_EL_ANGLE => self.electrical_angle(),
            R::MEAS_ROT_SPEED => s16(firmware.speed / SPEED),
            R::FLUXWK_BUS_MEAS => whole(foc.voltage.length() / FULL * 1000.0).min(1000),
            R::FF_VQ => s16(forward.y),
            R::FF_VD => s16(forward.x),
            R::FF_VQ_PIOUT => s16(foc.voltage.y) - s16(forward.y),
            R::FF_VD_PIOUT => s16(foc.voltage.x) - s16(forward.x),
            R::OBS_EL_ANGLE
            | R::OBS_ROT_SPEED
            | R::OBS_I_ALPHA
            | R::OBS_I_BETA
            | R::OBS_BEMF_ALPHA
            | R::OBS_BEMF_BETA
            | R::EST_BEMF_LEVEL
            | R::OBS_BEMF_LEVEL => self.observed(register, firmware.pll.as_ref()),
            _ => self.observed(register, firmware.cordic.as_ref()),
        }
    }

    /// The values of an observer; 0 while the motor is not driven.
    fn observed(&self, register: RegisterId, observer: Option<&Observer>) -> i32 {
        use RegisterId as R;
        let Some(observer) = observer.filter(|_| self.powered()) else { return 0 };
        // s16V refers to the present bus voltage.
        let share = self.bus_share();
        match register {
            R::OBS_EL_ANGLE | R::OBS_CR_EL_ANGLE => observer.degrees(),
            R::OBS_ROT_SPEED | R::OBS_CR_ROT_SPEED => s16(observer.speed()),
            R::OBS_I_ALPHA | R::OBS_CR_I_ALPHA => s16(observer.current().x),
            R::OBS_I_BETA | R::OBS_CR_I_BETA => s16(observer.current().y),
            R::OBS_BEMF_ALPHA | R::OBS_CR_BEMF_ALPHA => s16(observer.back_emf().x / share),
            R::OBS_BEMF_BETA | R::OBS_CR_BEMF_BETA => s16(observer.back_emf().y / share),
            R::EST_BEMF_LEVEL | R::EST_CR_BEMF_LEVEL => {
                s16(observer.expected_level() / (share * share))
            }
            R::OBS_BEMF_LEVEL | R::OBS_CR_BEMF_LEVEL => {
                s16(observer.observed_level() / (share * share))
            }
            _ => 0,
        }
    }

    /// The electrical angle that the drive measures or, without a sensor, estimates; s16degree.
    fn electrical_angle(&self) -> i32 {
        let pairs = i64::from(self.config.plant.machine.pole_pairs);
        let angle = match (self.firmware.frame, self.firmware.observer()) {
            _ if self.config.build.position_sensor => {
                self.position_from_zero().wrapping_mul(pairs) as u32
            }
            (Frame::Observed, Some(observer)) => return observer.degrees(),
            _ => self.firmware.forced,
        };
        i32::from((angle >> 16) as i16)
    }

    /// Writes a writable register.
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

    /// The output of DAC channel 1 or 2: the value of the selected register.
    pub fn dac(&self, channel: u8) -> i32 {
        let chosen = if channel == 2 { RegisterId::DAC_OUT2 } else { RegisterId::DAC_OUT1 };
        self.read(RegisterId(self.read(chosen) as u8))
    }

    /// Iq reference, s16A. Before a start: the reference of the start.
    fn torque_reference(&self) -> i32 {
        let control = &self.firmware.control;
        if self.running() {
            return control.iq_reference();
        }
        if self.powered() {
            return s16(self.firmware.foc.reference.y);
        }
        control.commanded_currents().map_or(0, |currents| currents.iq_s16a.into())
    }

    /// Id reference, s16A: of torque mode, or of speed mode; flux weakening adds to it.
    pub(super) fn flux_reference(&self) -> i32 {
        match self.firmware.control.commanded_currents() {
            Some(currents) => currents.id_s16a.into(),
            None => self.firmware.registers.iq_speedmode,
        }
    }

    /// Whether the power stage drives current.
    fn powered(&self) -> bool {
        self.firmware.frame != Frame::Off
    }
}
