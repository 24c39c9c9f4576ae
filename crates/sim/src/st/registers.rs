//! Registers that store a written value.
//!
//! The initial gains are derived from the machine ([`Registers::tuned`]); the table has the other
//! initial values.

use motorlink_proto::st::RegisterId;

/// Declares the registers: id, field, value at power-on without a motor, description.
macro_rules! stored {
    ($( $id:ident $field:ident = $default:expr, $doc:literal; )+) => {
        /// Registers that store a written value, in wire units. On the wire, a value that is too
        /// large for its register loses its upper bytes.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(
            feature = "serde",
            derive(serde::Serialize, serde::Deserialize),
            serde(default, deny_unknown_fields)
        )]
        pub struct Registers { $( #[doc = $doc] pub $field: i32, )+ }

        impl Registers {
            /// Registers without a motor: all gains are 0.
            pub(super) const BARE: Registers = Registers { $( $field: $default, )+ };

            /// The value of a register; `None` if it is not stored here.
            pub(super) const fn get(&self, register: RegisterId) -> Option<i32> {
                match register {
                    $( RegisterId::$id => Some(self.$field), )+
                    _ => None,
                }
            }

            /// The storage of a register.
            pub(super) const fn slot(&mut self, register: RegisterId) -> Option<&mut i32> {
                match register {
                    $( RegisterId::$id => Some(&mut self.$field), )+
                    _ => None,
                }
            }
        }
    };
}

stored! {
    SPEED_KP speed_kp = 0, "Speed regulator Kp, numerator, s16A per 0.1 Hz.";
    SPEED_KI speed_ki = 0, "Speed regulator Ki, numerator, s16A per 0.1 Hz and ms.";
    SPEED_KD speed_kd = 0, "Speed regulator Kd, numerator, s16A ms per 0.1 Hz.";
    SPEED_KP_DIV speed_kp_div = 16, "Divisor of Kp and Kd.";
    SPEED_KI_DIV speed_ki_div = 256, "Divisor of Ki.";
    TORQUE_KP torque_kp = 0, "Iq regulator Kp, numerator, s16V/s16A.";
    TORQUE_KI torque_ki = 0, "Iq regulator Ki, numerator, s16V/s16A.";
    TORQUE_KD torque_kd = 0, "Iq regulator Kd, numerator, s16V/s16A.";
    FLUX_KP flux_kp = 0, "Id regulator Kp, numerator, s16V/s16A.";
    FLUX_KI flux_ki = 0, "Id regulator Ki, numerator, s16V/s16A.";
    FLUX_KD flux_kd = 0, "Id regulator Kd, numerator, s16V/s16A.";
    OBSERVER_C1 observer_c1 = 0, "PLL observer's gain C1, numerator.";
    OBSERVER_C2 observer_c2 = 0, "PLL observer's gain C2, numerator, s16V/s16A.";
    OBSERVER_CR_C1 observer_cr_c1 = 0, "CORDIC observer's gain C1, numerator.";
    OBSERVER_CR_C2 observer_cr_c2 = 0, "CORDIC observer's gain C2, numerator, s16V/s16A.";
    PLL_KP pll_kp = 0, "PLL Kp, numerator, dpp/s16V.";
    PLL_KI pll_ki = 0, "PLL Ki, numerator, dpp/s16V.";
    FLUXWK_KP fluxwk_kp = 0, "Flux weakening Kp, s16A/s16V².";
    FLUXWK_KI fluxwk_ki = 0, "Flux weakening Ki, s16A/s16V².";
    FLUXWK_BUS fluxwk_bus = 985, "Share of the bus voltage that flux weakening may use, 0 to 1000 tenths of a percent, whatever the profile.";
    IQ_SPEEDMODE iq_speedmode = 0, "Id reference in speed mode, s16A.";
    FF_1Q ff_1q = 0, "Feed-forward constant C1q.";
    FF_1D ff_1d = 0, "Feed-forward constant C1d.";
    FF_2 ff_2 = 0, "Feed-forward constant C2.";
    POSITION_KP position_kp = 640, "Position regulator Kp, 1/16 rad/s per rad.";
    POSITION_KI position_ki = 0, "Position regulator Ki, 1/16 rad/s per rad s.";
    POSITION_KD position_kd = 0, "Position regulator Kd, 1/16 rad/s per rad/s.";
    PFC_DCBUS_REF pfc_dcbus_ref = 400, "Bus voltage that the PFC keeps, V.";
    PFC_STARTUP_DURATION pfc_startup_duration = 200, "Length of the PFC's start-up, ms.";
    PFC_I_KP pfc_i_kp = 0, "PFC current regulator Kp, s16V/s16A.";
    PFC_I_KI pfc_i_ki = 0, "PFC current regulator Ki, s16V/s16A.";
    PFC_I_KD pfc_i_kd = 0, "PFC current regulator Kd, s16V/s16A.";
    PFC_V_KP pfc_v_kp = 0, "PFC voltage regulator Kp, s16A/V.";
    PFC_V_KI pfc_v_ki = 0, "PFC voltage regulator Ki, s16A/V.";
    PFC_V_KD pfc_v_kd = 0, "PFC voltage regulator Kd, s16A/V.";
    DAC_OUT1 dac_out1 = 0x23, "Id of the register on DAC channel 1: I_A.";
    DAC_OUT2 dac_out2 = 0x24, "Id of the register on DAC channel 2: I_B.";
    DAC_USER1 dac_user1 = 0x1000, "User value of DAC channel 1.";
    DAC_USER2 dac_user2 = 0x2000, "User value of DAC channel 2.";
    MAX_APP_SPEED max_app_speed = 6000, "Highest speed of the application, rpm.";
    MIN_APP_SPEED min_app_speed = 600, "Lowest speed of the application, rpm.";
    UID uid = 0x4D4C_0001, "Unique identification.";
    CTRBID ctrbid = 0x011, "Control board.";
    PWBDID pwbdid = 0x01E, "Power board.";
    PWBDID2 pwbdid2 = 0x02C, "Power board of motor 2.";
}
