//! The supply: a source with a resistance, the bus capacitor, a brake chopper.
//!
//! ```text
//! C dV/dt = (V0 − V)/R + I_in − I_bridge − I_board − (chopper closed) V/R_brake
//! ```
//!
//! The integration uses the trapezoidal rule. It is stable for any R C, and its energies balance
//! exactly.

use core::ops::AddAssign;

use crate::control::{at_least, at_most};

/// The configuration of the supply.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct SupplyConfig {
    /// Voltage of the source, V.
    pub voltage: f32,
    /// Resistance of source and cable, Ω.
    pub resistance: f32,
    /// Capacitor on the bus, F.
    pub capacitance: f32,
    /// Whether the source accepts current, as a battery does. A rectifier or a bench supply does
    /// not: regeneration then raises the bus voltage.
    pub takes_back: bool,
    /// A brake chopper, if there is one.
    pub chopper: Option<ChopperConfig>,
}

/// A resistor that is switched on when the bus voltage is too high.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct ChopperConfig {
    /// The resistor, Ω.
    pub resistance: f32,
    /// Bus voltage at which it is switched on, V.
    pub on_voltage: f32,
    /// Bus voltage at which it is switched off again, V.
    pub off_voltage: f32,
}

impl Default for SupplyConfig {
    fn default() -> Self {
        SupplyConfig {
            voltage: 24.0,
            resistance: 0.05,
            capacitance: 470e-6,
            takes_back: false,
            chopper: None,
        }
    }
}

/// The energies of a step, J.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Flow {
    /// From the source and a second feed.
    pub(super) source: f32,
    /// Heat of the source's resistance.
    pub(super) lost: f32,
    /// Heat of the brake resistor.
    pub(super) braked: f32,
    /// Into the board.
    pub(super) board: f32,
}

impl AddAssign for Flow {
    fn add_assign(&mut self, step: Flow) {
        self.source += step.source;
        self.lost += step.lost;
        self.braked += step.braked;
        self.board += step.board;
    }
}

/// Currents of the bus in a step, other than those of the source and the brake resistor, A.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Currents {
    /// Into the bridge; negative out of it.
    pub(super) bridge: f32,
    /// Into the board.
    pub(super) board: f32,
    /// Into the bus from a second feed, such as a PFC.
    pub(super) fed: f32,
}

/// Current of a board with a power (W) from a bus (V), A. Below the minimum voltage of its
/// converter it falls with the voltage.
pub(crate) fn board_current(power: f32, bus: f32) -> f32 {
    const NEEDED: f32 = 5.0;
    let most = bus.max(NEEDED);
    power * bus / (most * most)
}

/// The bus.
#[derive(Debug, Clone)]
pub(super) struct Supply {
    config: SupplyConfig,
    state: State,
    /// One over the resistance, 1/Ω, and over twice the capacitance, 1/F.
    conductance: f32,
    half_inverse: f32,
    /// The last two steps. With constant currents rounding leaves the bus between two neighbours.
    last: [Option<Step>; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct State {
    /// Bus voltage below the source voltage, V: a small number keeps its precision.
    sag: f32,
    chopping: bool,
    /// Current out of the source in the last step, A.
    drawn: f32,
}

/// What a step did.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    dt: f32,
    currents: Currents,
    from: State,
    to: State,
    flow: Flow,
}

impl Supply {
    pub(super) fn new(config: SupplyConfig) -> Self {
        Supply {
            state: State::default(),
            conductance: 1.0 / config.resistance,
            half_inverse: 0.5 / config.capacitance,
            last: [None; 2],
            config,
        }
    }

    pub(super) const fn config(&self) -> &SupplyConfig {
        &self.config
    }

    /// Sets the voltage of the source, V.
    pub(super) fn set_source(&mut self, voltage: f32) {
        self.state.sag += voltage - self.config.voltage;
        self.config.voltage = voltage;
        self.last = [None; 2];
    }

    /// Voltage of the bus, V.
    pub(super) const fn voltage(&self) -> f32 {
        self.config.voltage - self.state.sag
    }

    /// Whether the brake resistor is on.
    pub(super) const fn chopping(&self) -> bool {
        self.state.chopping
    }

    /// Current out of the source in the last step, A.
    pub(super) const fn drawn(&self) -> f32 {
        self.state.drawn
    }

    /// Energy in the capacitor, J.
    pub(super) fn energy(&self) -> f32 {
        0.5 * self.config.capacitance * self.voltage() * self.voltage()
    }

    /// Whether the state remains unchanged while no current flows.
    pub(super) fn rests(&self) -> bool {
        const NEAR: f32 = 1e-5;
        let State { sag, chopping, .. } = self.state;
        let SupplyConfig { voltage: source, takes_back, chopper, .. } = self.config;
        let kept = sag < 0.0 && !takes_back;
        let quiet = chopper.is_none_or(|chopper| self.voltage() <= chopper.on_voltage);
        !chopping && quiet && (kept || sag.abs() <= NEAR * source)
    }

    /// Applies currents for `dt` (s). Adds the energies to `flow`.
    #[inline]
    pub(super) fn step(&mut self, dt: f32, currents: Currents, flow: &mut Flow) {
        let step;
        (self.state, step) = self.integrated(dt, currents);
        *flow += step;
    }

    /// The same for a motor at rest. Its bus repeats the last two steps.
    pub(super) fn rest(&mut self, dt: f32, currents: Currents, flow: &mut Flow) {
        let same = |it: &&Step| it.dt == dt && it.currents == currents && it.from == self.state;
        let step = match self.last.iter().flatten().find(same) {
            Some(step) => *step,
            None => {
                let (to, flow) = self.integrated(dt, currents);
                let step = Step { dt, currents, from: self.state, to, flow };
                self.last = [Some(step), self.last[0]];
                step
            }
        };
        self.state = step.to;
        *flow += step.flow;
    }

    #[inline]
    fn integrated(&self, dt: f32, currents: Currents) -> (State, Flow) {
        let Currents { bridge, board, fed } = currents;
        let State { sag, chopping, .. } = self.state;
        let SupplyConfig { voltage: source, takes_back, chopper, .. } = self.config;
        let chopping = chopper.is_some_and(|chopper| {
            self.voltage() > if chopping { chopper.off_voltage } else { chopper.on_voltage }
        });
        let brake = match chopper {
            Some(chopper) if chopping => 1.0 / chopper.resistance,
            _ => 0.0,
        };
        let gain = dt * self.half_inverse;
        // The mean sag of the step, with the source connected or not.
        let pulled = sag + gain * (bridge + board - fed + brake * source);
        let connected = takes_back || pulled >= 0.0;
        let conductance = if connected { self.conductance } else { 0.0 };
        let share = 1.0 / (1.0 + gain * (conductance + brake));
        // The bridge takes constant power: its current falls if the bus voltage rose since the
        // start of the step.
        let ratio = (self.voltage() / at_least(source - pulled * share, 1e-3)).clamp(0.5, 2.0);
        let middle = (pulled + gain * bridge * (ratio - 1.0)) * share;
        let middle = at_most(middle, source);
        let drawn = middle * conductance;
        let voltage = source - middle;
        let state = State { sag: at_most(2.0 * middle - sag, source), chopping, drawn };
        let flow = Flow {
            source: (source * drawn + voltage * fed) * dt,
            lost: drawn * middle * dt,
            board: voltage * board * dt,
            braked: voltage * voltage * brake * dt,
        };
        (state, flow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_is_known_is_the_one_that_would_be_computed() {
        const DT: f32 = 50e-6;
        let mut supply = Supply::new(SupplyConfig::default());
        let mut computed = supply.clone();
        let (mut flow, mut other) = (Flow::default(), Flow::default());
        let mut known = 0;
        for step in 0..6000 {
            if step == 5000 {
                supply.set_source(20.0);
                computed.set_source(20.0);
            }
            let bridge = if (1000..1010).contains(&step) { 3.0 } else { 0.0 };
            let board = if step < 3000 { 0.1 } else { 0.2 };
            let currents = Currents { bridge, board, fed: 0.0 };
            let before = supply.last;
            supply.rest(DT, currents, &mut flow);
            computed.step(DT, currents, &mut other);
            assert_eq!((supply.state, flow), (computed.state, other), "step {step}");
            known += u32::from(supply.last == before);
        }
        assert!(known > 5700, "{known}");
    }
}
