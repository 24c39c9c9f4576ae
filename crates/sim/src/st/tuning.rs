//! Default gains from a machine's values.
//!
//! | loop | rule | from |
//! |---|---|---|
//! | currents | internal model: Kp = ωc L, Ki = ωc R, with ωc a twentieth of the sampling frequency | L. Harnefors and H.-P. Nee, *Model-based current control of AC machines*, IEEE Trans. Ind. Appl. 34, 1998 |
//! | speed | symmetric optimum: Kp = J/(Kt a Tσ), Ti = a² Tσ with a = 3, where Tσ sums up the small delays | C. Kessler 1958; W. Leonhard, *Control of Electrical Drives* |
//! | observer | both poles at e^(-1/2) a period, see [`observer`](super::observer) | D. G. Luenberger 1971 |
//! | PLL | 600 rad/s, damping 1 at a quarter of the base speed; as its gain grows with the back-EMF, 1200 rad/s and 2 at base speed | F. M. Gardner, *Phaselock Techniques* |
//! | flux weakening | integral of the voltage's square, 100 rad/s at base speed | S.-K. Sul, *Control of Electric Machine Drive Systems*, on voltage feedback |
//! | feed-forward | back-EMF, and the voltage of each axis' current in the other | Leonhard |
//! | PFC | currents at 1 kHz, voltage at 10 Hz with damping 1 | as speed and currents |

use core::f32::consts::TAU;

use super::Registers;
use super::pfc;
use super::scale::{SPEED, Scale, divisor};
use crate::plant::PlantConfig;

/// Bandwidth of the current loops per sampling frequency.
const CURRENT_SHARE: f32 = 0.05;
/// Lag of the measured speed, s.
const SPEED_LAG: f32 = 3.3e-3;
/// Ratio of the speed loop's delays to its bandwidth.
const SYMMETRY: f32 = 3.0;
/// Logarithm of the observer's poles, a period.
const OBSERVER_POLE: f32 = -0.5;
/// Natural frequency of the PLL at a quarter of base speed, rad/s, where its damping is 1.
const PLL_FREQUENCY: f32 = 600.0;
/// Bandwidth of flux weakening at base speed, rad/s.
const WEAKENING: f32 = 100.0;
/// Time between two steps of the slow loops, s.
const SLOW: f32 = 1e-3;

impl Registers {
    /// Registers with gains for a motor and its board.
    pub fn tuned(plant: &PlantConfig) -> Self {
        let scale = Scale::new(plant);
        let machine = &plant.machine;
        let period = f32::from(plant.period_us) * 1e-6;
        let ohms = machine.resistance + plant.inverter.on_resistance;
        let resistance = scale.resistance(ohms);
        let (d, q) =
            (scale.resistance(machine.inductance_d), scale.resistance(machine.inductance_q));
        let bandwidth = TAU * CURRENT_SHARE / period;

        let inertia =
            machine.inertia + plant.load.inertia / (machine.gear.ratio * machine.gear.ratio);
        let delays = 1.5 * SLOW + 1.0 / bandwidth + SPEED_LAG;
        let per_speed = inertia / machine.torque_constant() * scale.ampere * SPEED;
        let speed_kp = per_speed / (SYMMETRY * delays);
        let speed_ki = speed_kp * SLOW / (SYMMETRY * SYMMETRY * delays);

        let lost = -libm::expm1f(-ohms * period / machine.inductance_q);
        let pole = libm::expf(OBSERVER_POLE);
        let c1 = 2.0 * pole - 2.0 + lost;
        let c2 = (1.0 - pole) * (1.0 - pole) / lost * resistance;

        let digits_per_radian = 65536.0 / TAU;
        let quarter = 0.25 * 32767.0;
        let step = PLL_FREQUENCY * period;
        let pll_kp = 2.0 * step * digits_per_radian / quarter;
        let pll_ki = step * step * digits_per_radian / quarter;

        let base = scale.nominal_voltage() / machine.back_emf_constant();
        let reactance = base * f32::from(machine.pole_pairs) * d;
        let fluxwk_ki = WEAKENING * SLOW / (2.0 * reactance);

        let electrical = f32::from(machine.pole_pairs) * SPEED;
        let cross = |inductance: f32| electrical * inductance * 32768.0;
        let back_emf = scale.volt * machine.back_emf_constant() * SPEED;

        let pfc = pfc::gains(plant, &scale);
        Registers {
            speed_kp: gain(speed_kp, Registers::BARE.speed_kp_div),
            speed_ki: gain(speed_ki, Registers::BARE.speed_ki_div),
            torque_kp: gain(bandwidth * q, divisor::CURRENT_KP),
            torque_ki: gain(bandwidth * period * resistance, divisor::CURRENT_KI),
            flux_kp: gain(bandwidth * d, divisor::CURRENT_KP),
            flux_ki: gain(bandwidth * period * resistance, divisor::CURRENT_KI),
            observer_c1: gain(c1, divisor::OBSERVER_C1),
            observer_c2: gain(c2, divisor::OBSERVER_C2),
            observer_cr_c1: gain(c1, divisor::OBSERVER_C1),
            observer_cr_c2: gain(c2, divisor::OBSERVER_C2),
            pll_kp: gain(pll_kp, divisor::PLL_KP),
            pll_ki: gain(pll_ki, divisor::PLL_KI),
            fluxwk_kp: gain(0.5 * fluxwk_ki, divisor::WEAKENING),
            fluxwk_ki: gain(fluxwk_ki, divisor::WEAKENING),
            ff_1q: whole(cross(d) * divisor::FEED_FORWARD),
            ff_1d: whole(cross(q) * divisor::FEED_FORWARD),
            ff_2: whole(back_emf * divisor::FEED_FORWARD),
            pfc_i_kp: gain(pfc.current.kp, divisor::PFC_KP),
            pfc_i_ki: gain(pfc.current.ki, divisor::PFC_KI),
            pfc_v_kp: gain(pfc.voltage.kp, divisor::PFC_VOLTAGE),
            pfc_v_ki: gain(pfc.voltage.ki, divisor::PFC_VOLTAGE),
            ..Registers::BARE
        }
    }
}

impl Default for Registers {
    fn default() -> Self {
        Registers::tuned(&crate::preset::mains())
    }
}

/// The numerator of a gain, limited to the range of its register.
fn gain(value: f32, divisor: i32) -> i32 {
    whole(value * divisor as f32).clamp(i16::MIN.into(), i16::MAX.into())
}

fn whole(value: f32) -> i32 {
    libm::roundf(value) as i32
}
