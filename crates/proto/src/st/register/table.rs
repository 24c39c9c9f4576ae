//! Table 3 row by row, followed by the registers that only shipped firmware has.
//!
//! The columns of a row: id, name, type, unit, access, feature that the drive must be built with,
//! source. If firmware of `mcsdk-5.4` has another type, it follows after `|`. If its sizes differ
//! from the access, `mcsdk(read, write)` has the bits of its GET_REG reply and of its SET_REG
//! value; 0 means not handled. `set(effect, limited)` says what a write does that commands the drive or
//! has a limit.

use super::access::{Access, Origin};
use super::feature::Feature;
use super::id::RegisterId;
use super::index::{Index, runs};
use super::row::{REFUSED, Row, Rows, distinct};
use super::shape::Text;
use super::typed::{Dac, Never, ReadOnly, ReadWrite, Register, WriteOnly};
use super::unit::Unit;
use super::value::Value;
use crate::st::effect::{Effect, Limited};

/// Declares the registers: typed constants, ids for matching, shapes and texts. Ids ascend and may
/// be sparse. A row out of order does not compile.
macro_rules! registers {
    ($(
        $id:literal $name:ident: $ty:ident $(| $mcsdk:ident)?, $unit:ident, $access:ident, $feature:ident,
        $origin:ident $(mcsdk($get:expr, $set:expr))? $(set($effect:ident, $limited:ident))?, $doc:literal;
    )+) => {
        $( #[doc = concat!($doc, " (", stringify!($id), ")")]
           pub const $name: Register<rust_type!($ty $($mcsdk)?), $access> = Register::new($id); )+

        impl RegisterId {
            $( #[doc = concat!($doc, " (", stringify!($id), ")")]
               pub const $name: RegisterId = RegisterId($id); )+

            /// The effect of SET_REG to this register.
            pub const fn effect(self) -> Effect {
                match self.0 {
                    $( $( $id => Effect::$effect, )? )+
                    _ => Effect::None,
                }
            }

            /// What a write sets that has a limit.
            pub(in crate::st) const fn limited(self) -> Limited {
                match self.0 {
                    $( $( $id => Limited::$limited, )? )+
                    _ => Limited::Nothing,
                }
            }
        }

        /// The id of every row.
        pub(super) const IDS: [RegisterId; [$($id),+].len()] = [$( RegisterId($id) ),+];

        /// The row of every id.
        pub(super) const INDEX: Index<{ runs(&[$($id),+]) }> = Index::new(&[$($id),+]);

        const COLUMNS: [Row; IDS.len()] = [
            $( Row::new(
                (<$ty as Value>::TYPE, Unit::$unit, Access::$access, Feature::$feature,
                 Origin::$origin),
                <mcsdk_type!($ty $($mcsdk)?) as Value>::TYPE,
                optional_pair!($($get, $set)?),
            ), )+
        ];

        /// What a slave needs of every register, in the order of the ids.
        pub(super) static ROWS: Rows<{ IDS.len() }, { distinct(&COLUMNS) }> = Rows::new(&COLUMNS);

        /// The unit of every register, in the order of the ids.
        pub(super) static UNITS: [Unit; IDS.len()] = [$( Unit::$unit, )+];

        /// The texts of every register, in the order of the ids.
        pub static TEXTS: [Text; IDS.len()] = [$( Text { name: stringify!($name), doc: $doc }, )+];
    };
}

/// The Rust type that can hold a register's value in both profiles.
macro_rules! rust_type {
    ($ty:ident) => {
        $ty
    };
    (u16 i16) => {
        i32
    };
    (u32 u16) => {
        u32
    };
}

macro_rules! mcsdk_type {
    ($ty:ident) => {
        $ty
    };
    ($ty:ident $mcsdk:ident) => {
        $mcsdk
    };
}

macro_rules! optional_pair {
    () => {
        None
    };
    ($get:expr, $set:expr) => {
        Some(($get, $set))
    };
}

registers! {
    0x00 TARGET_MOTOR: u8, MotorIndex, ReadWrite, Core, Table3 set(Retargets, Nothing), "Motor that motor number 0 addresses; the value 0 is motor 1";
    0x01 FLAGS: u32, Flags, ReadOnly, Core, Table3, "Faults: low half occurred, high half present";
    0x02 STATUS: u8, Status, ReadOnly, Core, Table3, "State of the state machine";
    0x03 CONTROL_MODE: u8, ControlMode, ReadWrite, Core, Table3 set(Supersedes, Nothing), "Torque (0) or speed (1) control";
    0x04 SPEED_REF: i32, Rpm, ReadOnly, Core, Table3, "Speed reference";
    0x05 SPEED_KP: i16, S16APerUnit, ReadWrite, Core, Table3, "Speed regulator Kp, numerator";
    0x06 SPEED_KI: i16, S16APerUnit, ReadWrite, Core, Table3, "Speed regulator Ki, numerator";
    0x07 SPEED_KD: i16, S16APerUnit, ReadWrite, Core, Table3, "Speed regulator Kd, numerator";
    0x08 TORQUE_REF: i16, S16A, ReadWrite, Core, Table3 set(Supersedes, Current), "Iq reference";
    0x09 TORQUE_KP: i16, S16VPerS16A, ReadWrite, Core, Table3, "Iq regulator Kp, numerator";
    0x0A TORQUE_KI: i16, S16VPerS16A, ReadWrite, Core, Table3, "Iq regulator Ki, numerator";
    0x0B TORQUE_KD: i16, S16VPerS16A, ReadWrite, Core, Table3, "Iq regulator Kd, numerator";
    0x0C FLUX_REF: i16, S16A, ReadWrite, Core, Table3 set(Supersedes, Current), "Id reference";
    0x0D FLUX_KP: i16, S16VPerS16A, ReadWrite, Core, Table3, "Id regulator Kp, numerator";
    0x0E FLUX_KI: i16, S16VPerS16A, ReadWrite, Core, Table3, "Id regulator Ki, numerator";
    0x0F FLUX_KD: i16, S16VPerS16A, ReadWrite, Core, Table3, "Id regulator Kd, numerator";
    0x10 OBSERVER_C1: i16, None, ReadWrite, ObserverPll, Table3 mcsdk(16, 32), "Observer gain C1 (PLL)";
    0x11 OBSERVER_C2: i16, None, ReadWrite, ObserverPll, Table3 mcsdk(16, 32), "Observer gain C2 (PLL)";
    0x12 OBSERVER_CR_C1: i16, None, ReadWrite, ObserverCordic, Table3 mcsdk(16, 0), "Observer gain C1 (CORDIC)";
    0x13 OBSERVER_CR_C2: i16, None, ReadWrite, ObserverCordic, Table3 mcsdk(16, 0), "Observer gain C2 (CORDIC)";
    0x14 PLL_KI: i16, DppPerS16V, ReadWrite, ObserverPll, Table3, "PLL regulator Ki, numerator";
    0x15 PLL_KP: i16, DppPerS16V, ReadWrite, ObserverPll, Table3, "PLL regulator Kp, numerator";
    0x16 FLUXWK_KP: i16, S16APerS16VSquared, ReadWrite, FluxWeakening, Table3, "Flux weakening regulator Kp";
    0x17 FLUXWK_KI: i16, S16APerS16VSquared, ReadWrite, FluxWeakening, Table3, "Flux weakening regulator Ki";
    0x18 FLUXWK_BUS: u16, Percent, ReadWrite, FluxWeakening, Table3, "Share of the bus voltage that flux weakening may use";
    0x19 BUS_VOLTAGE: u16, Volt, ReadOnly, Core, Table3, "Bus voltage";
    0x1A HEATS_TEMP: u16 | i16, Celsius, ReadOnly, Core, Table3, "Heatsink temperature";
    0x1B MOTOR_POWER: u16 | i16, Watt, ReadOnly, Core, Table3, "Electrical power into the motor";
    0x1C DAC_OUT1: u8, Register, ReadWrite, Dac, Table3, "Register shown on DAC channel 1";
    0x1D DAC_OUT2: u8, Register, ReadWrite, Dac, Table3, "Register shown on DAC channel 2";
    0x1E SPEED_MEAS: i32, Rpm, ReadOnly, Core, Table3, "Mechanical speed, averaged";
    0x1F TORQUE_MEAS: i16, S16A, ReadOnly, Core, Table3, "Iq, measured";
    0x20 FLUX_MEAS: i16, S16A, ReadOnly, Core, Table3, "Id, measured";
    0x21 FLUXWK_BUS_MEAS: u16, Percent, ReadOnly, FluxWeakening, Table3, "Share of the bus voltage in use";
    0x22 RUC_STAGE_NBR: u8, None, ReadOnly, Core, Table3, "Number of rev-up phases";
    0x23 I_A: i16, S16A, Dac, Core, Table3, "Phase A current";
    0x24 I_B: i16, S16A, Dac, Core, Table3, "Phase B current";
    0x25 I_ALPHA: i16, S16A, Dac, Core, Table3, "Alpha current";
    0x26 I_BETA: i16, S16A, Dac, Core, Table3, "Beta current";
    0x27 I_Q: i16, S16A, Dac, Core, Table3, "Iq, measured";
    0x28 I_D: i16, S16A, Dac, Core, Table3, "Id, measured";
    0x29 I_Q_REF: i16, S16A, Dac, Core, Table3, "Iq reference";
    0x2A I_D_REF: i16, S16A, Dac, Core, Table3, "Id reference";
    0x2B V_Q: i16, S16V, Dac, Core, Table3, "Vq";
    0x2C V_D: i16, S16V, Dac, Core, Table3, "Vd";
    0x2D V_ALPHA: i16, S16V, Dac, Core, Table3, "Alpha voltage";
    0x2E V_BETA: i16, S16V, Dac, Core, Table3, "Beta voltage";
    0x2F MEAS_EL_ANGLE: i16, S16Degree, Dac, PositionSensor, Table3, "Electrical angle from the sensor";
    0x30 MEAS_ROT_SPEED: i16, S16Speed, Dac, PositionSensor, Table3, "Mechanical speed from the sensor";
    0x31 OBS_EL_ANGLE: i16, S16Degree, Dac, ObserverPll, Table3, "Observed electrical angle (PLL)";
    0x32 OBS_ROT_SPEED: i16, S16Speed, Dac, ObserverPll, Table3, "Observed mechanical speed (PLL)";
    0x33 OBS_I_ALPHA: i16, S16A, Dac, ObserverPll, Table3, "Estimated alpha current (PLL)";
    0x34 OBS_I_BETA: i16, S16A, Dac, ObserverPll, Table3, "Estimated beta current (PLL)";
    0x35 OBS_BEMF_ALPHA: i16, S16V, Dac, ObserverPll, Table3, "Observed back-EMF, alpha (PLL)";
    0x36 OBS_BEMF_BETA: i16, S16V, Dac, ObserverPll, Table3, "Observed back-EMF, beta (PLL)";
    0x37 OBS_CR_EL_ANGLE: i16, S16Degree, Dac, ObserverCordic, Table3, "Observed electrical angle (CORDIC)";
    0x38 OBS_CR_ROT_SPEED: i16, S16Speed, Dac, ObserverCordic, Table3, "Observed mechanical speed (CORDIC)";
    0x39 OBS_CR_I_ALPHA: i16, S16A, Dac, ObserverCordic, Table3, "Estimated alpha current (CORDIC)";
    0x3A OBS_CR_I_BETA: i16, S16A, Dac, ObserverCordic, Table3, "Estimated beta current (CORDIC)";
    0x3B OBS_CR_BEMF_ALPHA: i16, S16V, Dac, ObserverCordic, Table3, "Observed back-EMF, alpha (CORDIC)";
    0x3C OBS_CR_BEMF_BETA: i16, S16V, Dac, ObserverCordic, Table3, "Observed back-EMF, beta (CORDIC)";
    0x3D DAC_USER1: i16, None, Dac, Dac, Table3, "User value of DAC channel 1";
    0x3E DAC_USER2: i16, None, Dac, Dac, Table3, "User value of DAC channel 2";
    0x3F MAX_APP_SPEED: u32, Rpm, ReadOnly, Core, Table3 mcsdk(0, 0), "Highest speed of the application";
    0x40 MIN_APP_SPEED: u32, Rpm, ReadOnly, Core, Table3 mcsdk(0, 0), "Lowest speed of the application";
    0x41 IQ_SPEEDMODE: i16, S16A, WriteOnly, Core, Table3 mcsdk(16, 16) set(None, Current), "Id reference in speed mode; the document also says Iq (S22)";
    0x42 EST_BEMF_LEVEL: i16, S16VSquared, ReadOnly, ObserverPll, Table3 mcsdk(0, 0), "Expected back-EMF level (PLL)";
    0x43 OBS_BEMF_LEVEL: i16, S16VSquared, ReadOnly, ObserverPll, Table3 mcsdk(0, 0), "Observed back-EMF level (PLL)";
    0x44 EST_CR_BEMF_LEVEL: i16, S16VSquared, ReadOnly, ObserverCordic, Table3 mcsdk(0, 0), "Expected back-EMF level (CORDIC)";
    0x45 OBS_CR_BEMF_LEVEL: i16, S16VSquared, ReadOnly, ObserverCordic, Table3 mcsdk(0, 0), "Observed back-EMF level (CORDIC)";
    0x46 FF_1Q: i32, None, ReadWrite, FeedForward, Table3, "Feed-forward constant C1q";
    0x47 FF_1D: i32, None, ReadWrite, FeedForward, Table3, "Feed-forward constant C1d";
    0x48 FF_2: i32, None, ReadWrite, FeedForward, Table3, "Feed-forward constant C2";
    0x49 FF_VQ: i16, S16V, ReadOnly, FeedForward, Table3, "Feed-forward part of Vq";
    0x4A FF_VD: i16, S16V, ReadOnly, FeedForward, Table3, "Feed-forward part of Vd";
    0x4B FF_VQ_PIOUT: i16, S16V, ReadOnly, FeedForward, Table3, "Regulator part of Vq";
    0x4C FF_VD_PIOUT: i16, S16V, ReadOnly, FeedForward, Table3, "Regulator part of Vd";
    0x4D PFC_STATUS: i8, None, ReadOnly, Pfc, Table3, "PFC state";
    0x4E PFC_FAULTS: u32, None, ReadOnly, Pfc, Table3, "PFC faults";
    0x4F PFC_DCBUS_REF: i16, Volt, ReadWrite, Pfc, Table3, "PFC bus voltage reference";
    0x50 PFC_DCBUS_MEAS: i16, Volt, ReadOnly, Pfc, Table3, "PFC bus voltage";
    0x51 PFC_ACBUS_FREQ: i16, DeciHertz, ReadOnly, Pfc, Table3, "Mains frequency";
    0x52 PFC_ACBUS_RMS: i16, Volt, ReadOnly, Pfc, Table3, "Mains voltage, zero to peak";
    0x53 PFC_I_KP: i16, S16VPerS16A, ReadWrite, Pfc, Table3, "PFC current regulator Kp";
    0x54 PFC_I_KI: i16, S16VPerS16A, ReadWrite, Pfc, Table3, "PFC current regulator Ki";
    0x55 PFC_I_KD: i16, S16VPerS16A, ReadWrite, Pfc, Table3, "PFC current regulator Kd";
    0x56 PFC_V_KP: i16, S16APerVolt, ReadWrite, Pfc, Table3, "PFC voltage regulator Kp";
    0x57 PFC_V_KI: i16, S16APerVolt, ReadWrite, Pfc, Table3, "PFC voltage regulator Ki";
    0x58 PFC_V_KD: i16, S16APerVolt, ReadWrite, Pfc, Table3, "PFC voltage regulator Kd";
    0x59 PFC_STARTUP_DURATION: i16, Millisecond, ReadWrite, Pfc, Table3, "Length of the PFC start-up";
    0x5A PFC_ENABLED: i8, None, ReadOnly, Pfc, Table3, "Whether the PFC is enabled";
    0x5B RAMP_FINAL_SPEED: i32, Rpm, ReadWrite, Core, Table3 set(Ramps, Speed), "Final speed of the ramp";
    0x5C RAMP_DURATION: u16, Millisecond, Never, Core, Firmware, "Length of the ramp";
    0x5D HFI_EL_ANGLE: i16, S16Degree, ReadOnly, Hfi, Firmware, "Electrical angle from HFI";
    0x5E HFI_ROT_SPEED: i16, S16Speed, ReadOnly, Hfi, Firmware, "Mechanical speed from HFI";
    0x5F HFI_CURRENT: i16, S16A, ReadOnly, Hfi, Firmware, "HFI current";
    0x60 HFI_INIT_ANG_PLL: i16, S16Degree, ReadOnly, Hfi, Firmware, "Initial angle from the HFI PLL";
    0x61 HFI_INIT_ANG_SAT_DIFF: i16, None, ReadWrite, Hfi, Firmware, "Initial angle saturation difference";
    0x62 HFI_PI_PLL_KP: i16, None, Never, Hfi, Firmware, "HFI PLL Kp";
    0x63 HFI_PI_PLL_KI: i16, None, Never, Hfi, Firmware, "HFI PLL Ki";
    0x64 HFI_PI_TRACK_KP: i16, None, ReadWrite, Hfi, Firmware, "HFI tracking Kp";
    0x65 HFI_PI_TRACK_KI: i16, None, ReadWrite, Hfi, Firmware, "HFI tracking Ki";
    0x66 SC_CHECK: u8, None, ReadOnly, Profiler, Firmware, "Profiler is built in";
    0x67 SC_STATE: u8, None, ReadOnly, Profiler, Firmware, "Profiler state";
    0x68 SC_RS: f32, Ohm, ReadOnly, Profiler, Firmware, "Profiler: stator resistance";
    0x69 SC_LS: f32, Henry, ReadOnly, Profiler, Firmware, "Profiler: stator inductance";
    0x6A SC_KE: f32, None, ReadOnly, Profiler, Firmware, "Profiler: back-EMF constant";
    0x6B SC_VBUS: f32, Volt, ReadOnly, Profiler, Firmware, "Profiler: bus voltage";
    0x6C SC_MEAS_NOMINALSPEED: f32, Rpm, ReadOnly, Profiler, Firmware, "Profiler: measured nominal speed";
    0x6D SC_STEPS: u8, None, ReadOnly, Profiler, Firmware, "Profiler: number of steps";
    0x6E SPEED_KP_DIV: i16, None, ReadOnly, Core, Table3, "Speed regulator Kp, divisor";
    0x6F SPEED_KI_DIV: i16, None, ReadOnly, Core, Table3, "Speed regulator Ki, divisor";
    0x70 UID: u32, None, ReadOnly, Core, Firmware, "Unique identification";
    0x71 HWTYPE: i16, None, Never, Core, Firmware, "Hardware type";
    0x72 CTRBID: u32 | u16, None, ReadOnly, Core, Table3, "Control board identification";
    0x73 PWBDID: u32 | u16, None, ReadOnly, Core, Table3, "Power board identification";
    0x74 SC_PP: u8, None, ReadWrite, Profiler, Firmware, "Profiler: pole pairs";
    0x75 SC_CURRENT: f32, Ampere, ReadWrite, Profiler, Firmware, "Profiler: current";
    0x76 SC_SPDBANDWIDTH: f32, None, ReadWrite, Profiler, Firmware, "Profiler: speed bandwidth";
    0x77 SC_LDLQRATIO: f32, None, ReadWrite, Profiler, Firmware, "Profiler: Ld/Lq ratio";
    0x78 SC_NOMINAL_SPEED: u32, Rpm, ReadWrite, Profiler, Firmware, "Profiler: nominal speed";
    0x79 SC_CURRBANDWIDTH: f32, None, ReadWrite, Profiler, Firmware, "Profiler: current bandwidth";
    0x7A SC_J: f32, None, ReadOnly, Profiler, Firmware, "Profiler: inertia";
    0x7B SC_F: f32, None, ReadOnly, Profiler, Firmware, "Profiler: friction";
    0x7C SC_MAX_CURRENT: f32, Ampere, ReadOnly, Profiler, Firmware, "Profiler: highest current";
    0x7D SC_STARTUP_SPEED: u32, Rpm, ReadOnly, Profiler, Firmware mcsdk(32, REFUSED), "Profiler: start-up speed";
    0x7E SC_STARTUP_ACC: u32, None, ReadOnly, Profiler, Firmware mcsdk(32, REFUSED), "Profiler: start-up acceleration";
    0x7F SC_PWM_FREQUENCY: u32, Hertz, ReadOnly, Profiler, Firmware, "Profiler: PWM frequency";
    0x80 SC_FOC_REP_RATE: u8, None, ReadOnly, Profiler, Firmware, "Profiler: FOC repetition rate";
    0x81 PWBDID2: u32, None, ReadOnly, Core, Table3 mcsdk(0, 0), "Power board identification, motor 2";
    0x82 SC_COMPLETED: u8, None, ReadOnly, Profiler, Firmware, "Profiler has completed";
    0x83 CURRENT_POSITION: f32, Radian, ReadOnly, PositionControl, Firmware, "Position";
    0x84 TARGET_POSITION: f32, Radian, ReadOnly, PositionControl, Firmware, "Target position";
    0x85 MOVE_DURATION: f32, Second, ReadOnly, PositionControl, Firmware, "Duration of the move";
    0x86 POSITION_KP: i16, None, ReadWrite, PositionControl, Firmware, "Position regulator Kp";
    0x87 POSITION_KI: i16, None, ReadWrite, PositionControl, Firmware, "Position regulator Ki";
    0x88 POSITION_KD: i16, None, ReadWrite, PositionControl, Firmware, "Position regulator Kd";
}
