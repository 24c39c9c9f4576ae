//! The machine: a permanent-magnet synchronous motor on a shaft.
//!
//! # Equations
//!
//! Windings, in the stator's frame with the flux linkage ψ as state (Park's equations, see P. Krause
//! and others, *Analysis of Electric Machinery and Drive Systems*, chapter on synchronous machines):
//!
//! ```text
//! dψ/dt = v − R i            ψd = Ld id + ψm,   ψq = Lq iq
//! T     = 1.5 p ψ × i        = 1.5 p (ψm iq + (Ld − Lq) id iq)
//! ```
//!
//! In the rotor's frame Ld id and Lq iq turn back with the electrical speed ω and die away with R/L.
//! What the axes have in common of that, a = R (1/Ld + 1/Lq) / 2, and voltage and back-EMF are solved
//! exactly for half a step of constant speed, as complex numbers:
//!
//! ```text
//! f(h/2) = E f + (1 − E) / (a + jω) (v − jω ψm),   E = exp(−(a + jω) h/2)
//! ```
//!
//! A voltage that stands still in the stator's frame adds (1 − exp(−a h/2)) / a of itself, as the
//! rotor sees it at the end. What the axes differ in, ±R (1/Ld − 1/Lq) / 2, acts in between for h/6,
//! 4h/6 and h/6 (split symmetrically, Strang, *On the construction and comparison of difference
//! schemes*, SIAM J. Numer. Anal. 5, 1968) and is nothing in a motor without saliency. The torque is
//! Simpson's mean of begin, middle and end.
//!
//! Shaft, at the rotor, with gear ratio N and n periods of cogging a turn:
//!
//! ```text
//! J dω/dt = T − Tcog sin(n θ) + T_load/N − (B + Beddy) ω − dry(ω) sign ω
//! dry     = Tc + (Ts − Tc) / (1 + (ω/ωs)²) + hysteresis + (brake + (1/η − 1) |T_load|) / N
//! ```
//!
//! Viscous friction is implicit, also the load's; dry friction takes away speed but never more than there is, so a
//! rotor stays where what pulls it is less (stiction with the Stribeck effect, see B. Armstrong,
//! *A survey of models, analysis tools and compensation methods for the control of machines with
//! friction*, Automatica 30, 1994). Torques that depend on the position are taken in the middle of
//! the step. Iron losses are torques against the motion: hysteresis does not depend on speed, eddy
//! currents are in proportion to it.

use super::load::{Load, LoadConfig};
use crate::angle::{self, TURN, sin_cos};
use crate::control::within;
use crate::vector::Vector;

/// What a machine is. A machine's values belong together: start from a
/// [preset](crate::preset), not from nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct MachineConfig {
    /// Pairs of poles.
    pub pole_pairs: u8,
    /// Phase resistance at 25 °C, Ω.
    pub resistance: f32,
    /// Inductance along the magnet, H.
    pub inductance_d: f32,
    /// Inductance across the magnet, H.
    pub inductance_q: f32,
    /// Amplitude of the magnet's flux linkage in a phase, Wb.
    pub flux_linkage: f32,
    /// Inertia of the rotor, kg m².
    pub inertia: f32,
    /// Friction that grows with speed, Nm s/rad.
    pub viscous_friction: f32,
    /// Friction of a turning rotor that does not, Nm.
    pub coulomb_friction: f32,
    /// Friction that holds a rotor at rest, Nm; no less than the Coulomb friction.
    pub stiction: f32,
    /// Speed at which half of the difference between both is gone, rad/s.
    pub stribeck_speed: f32,
    /// Amplitude of the cogging torque, Nm.
    pub cogging_torque: f32,
    /// Periods of the cogging torque a turn: the least common multiple of slots and poles.
    pub cogging_periods: u16,
    /// Torque of the iron's hysteresis loss, Nm.
    pub iron_hysteresis: f32,
    /// Torque of the iron's eddy current loss per speed, Nm s/rad.
    pub iron_eddy: f32,
    /// The gear behind the rotor.
    pub gear: GearConfig,
}

/// A gear.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct GearConfig {
    /// Turns of the rotor for a turn of the output; 1 without a gear.
    pub ratio: f32,
    /// Share of the power that gets through, 0 to 1.
    pub efficiency: f32,
}

impl Default for GearConfig {
    fn default() -> Self {
        GearConfig { ratio: 1.0, efficiency: 1.0 }
    }
}

impl MachineConfig {
    /// Torque at the rotor per Iq at Id = 0, Nm/A.
    pub fn torque_constant(&self) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.flux_linkage
    }

    /// Amplitude of a phase's back-EMF per speed of the rotor, V s/rad.
    pub fn back_emf_constant(&self) -> f32 {
        f32::from(self.pole_pairs) * self.flux_linkage
    }
}

/// Growth of copper's resistance from 25 °C, 1/K: it would be nothing at -234.5 °C.
const COPPER: f32 = 1.0 / 259.5;

/// Greatest growth of the resistance: copper boils at 2560 °C.
const VAPOUR: f32 = 10.0;

/// Steps after which rounding has done nothing to the rotor's frame yet.
const EXACT: u8 = 32;

/// Up to which what a step missed of the electrical angle does not stretch the frame, rad.
const NEAR: f32 = 0.01;

/// What the windings are fed with for a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Feed {
    /// A voltage that stands still in the stator's frame, V.
    Stator(Vector),
    /// A voltage that turns with the rotor, V: d and q.
    Rotor(Vector),
}

/// Where the energy of a step went, J.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flow {
    /// Into the terminals.
    pub electrical: f32,
    /// Heat of the windings and of what is in series with them.
    pub copper: f32,
    /// Viscous and dry friction of the rotor.
    pub friction: f32,
    /// Iron losses.
    pub iron: f32,
    /// Loss of the gear.
    pub gear: f32,
    /// Into what the output drives, without what its springs and weights keep.
    pub load: f32,
}

/// A motor with what hangs on its shaft, integrated in steps of one length.
#[derive(Debug, Clone)]
pub struct Machine {
    config: MachineConfig,
    load: Load,
    locked: bool,
    /// Length of a step, s.
    period: f32,
    /// Phase resistance now, Ω, and what is in series with it.
    resistance: f32,
    series: f32,
    decay: Decay,
    shaft: Shaft,
    /// Pairs of poles.
    poles: f32,
    /// One over the speed of the Stribeck effect, s/rad.
    inverse_stribeck: f32,
    /// One over the inductances, 1/H.
    inverse: Vector,
    /// Ld id and Lq iq, Wb.
    flux: Vector,
    /// Current in the stator's frame, A.
    current: Vector,
    /// Where the rotor is: its electrical angle as a unit vector, turned along step by step and
    /// taken from the position every [`EXACT`] steps.
    frame: Vector,
    count: u8,
    /// rad/s.
    speed: f32,
    /// What the last step added to the speed, rad/s, and what rounding left out of it.
    change: f32,
    rest: f32,
    /// 2^32 a turn.
    position: i64,
    /// Electromagnetic torque, mean of the last step, Nm.
    torque: f32,
}

/// What the resistance does in a step.
#[derive(Debug, Clone)]
struct Decay {
    /// What the axes have in common: its rate, 1/s, what is gone of a flux linkage after half a step,
    /// and the time for which a voltage that stands still acts in it, s.
    rate: f32,
    gone: f32,
    drive: f32,
    /// What they differ in: what a sixth and what two sixths of a step add, as a share.
    outer: Vector,
    inner: Vector,
    /// Whether they differ at all.
    salient: bool,
}

impl Decay {
    fn new(period: f32, resistance: f32, inverse: Vector) -> Self {
        let rate = 0.5 * resistance * (inverse.x + inverse.y);
        let gone = -libm::expm1f(-0.5 * rate * period);
        let drive = if gone > 0.0 { gone / rate } else { 0.5 * period };
        let beyond = 0.5 * resistance * (inverse.x - inverse.y);
        let change = |share: f32| {
            let exponent = beyond * period * share;
            Vector::new(libm::expm1f(-exponent), libm::expm1f(exponent))
        };
        Decay {
            rate,
            gone,
            drive,
            outer: change(1.0 / 6.0),
            inner: change(1.0 / 3.0),
            salient: beyond != 0.0,
        }
    }
}

/// What a step needs of all that turns.
#[derive(Debug, Clone)]
struct Shaft {
    /// Inertia at the rotor, kg m².
    inertia: f32,
    /// Speed per torque of a step, rad/s/Nm.
    gain: f32,
    /// What viscous friction takes of a speed, per what it leaves.
    viscous: f32,
}

impl Shaft {
    fn new(config: &MachineConfig, load: &Load, period: f32) -> Self {
        let inertia = config.inertia + load.inertia();
        let gain = period / inertia;
        let viscous = gain * (config.viscous_friction + config.iron_eddy);
        Shaft { inertia, gain, viscous }
    }
}

impl Machine {
    /// A machine at rest and without current, with its rotor at 0, for steps of `period` (s).
    pub fn new(config: MachineConfig, load: LoadConfig, period: f32) -> Self {
        let load = Load::new(load, config.gear);
        let inverse = Vector::new(1.0 / config.inductance_d, 1.0 / config.inductance_q);
        Machine {
            shaft: Shaft::new(&config, &load, period),
            decay: Decay::new(period, config.resistance, inverse),
            load,
            locked: false,
            poles: f32::from(config.pole_pairs),
            period,
            resistance: config.resistance,
            series: 0.0,
            inverse_stribeck: 1.0 / config.stribeck_speed,
            inverse,
            flux: Vector::ZERO,
            current: Vector::ZERO,
            frame: Vector::unit(0),
            count: 0,
            speed: 0.0,
            change: 0.0,
            rest: 0.0,
            position: 0,
            torque: 0.0,
            config,
        }
    }

    /// Puts the rotor at a position (2^32 a turn) with a speed (rad/s).
    pub fn place(&mut self, position: i64, speed: f32) {
        (self.position, self.speed) = (position, speed);
        (self.change, self.rest) = (0.0, 0.0);
        self.frame = Vector::unit(self.electrical_angle());
    }

    /// Puts a resistance (Ω) in series with each phase.
    pub fn set_series(&mut self, resistance: f32) {
        self.series = resistance;
        self.decay = Decay::new(self.period, self.resistance + self.series, self.inverse);
    }

    /// What the machine is.
    pub const fn config(&self) -> &MachineConfig {
        &self.config
    }

    /// What hangs on the output.
    pub const fn load(&self) -> &LoadConfig {
        self.load.config()
    }

    /// Hangs something else on the output.
    pub fn set_load(&mut self, load: LoadConfig) {
        self.load = Load::new(load, self.config.gear);
        self.shaft = Shaft::new(&self.config, &self.load, self.period);
    }

    /// Holds the rotor where it is, or lets it go.
    pub const fn lock(&mut self, locked: bool) {
        self.locked = locked;
    }

    /// Whether the rotor is held.
    pub const fn locked(&self) -> bool {
        self.locked
    }

    /// Speed of the rotor, rad/s.
    pub const fn speed(&self) -> f32 {
        self.speed
    }

    /// Position of the rotor over all turns, [`TURN`] a turn.
    pub const fn position(&self) -> i64 {
        self.position
    }

    /// Position of the output over all turns, [`TURN`] a turn.
    pub fn output_position(&self) -> i64 {
        (self.position as f64 / f64::from(self.config.gear.ratio)) as i64
    }

    /// Electrical angle, 2^32 a turn.
    pub fn electrical_angle(&self) -> u32 {
        electrical(self.position, &self.config)
    }

    /// Current in the stator's frame, A.
    pub const fn current(&self) -> Vector {
        self.current
    }

    /// Current in the rotor's frame, A: Id and Iq.
    pub fn rotor_current(&self) -> Vector {
        self.flux.scaled(self.inverse)
    }

    /// Back-EMF in the stator's frame, V.
    pub fn back_emf(&self) -> Vector {
        let amplitude = self.speed * self.config.back_emf_constant();
        Vector::new(-self.frame.y, self.frame.x) * amplitude
    }

    /// Electromagnetic torque, mean of the last step, Nm.
    pub const fn torque(&self) -> f32 {
        self.torque
    }

    /// Torque that the load puts on the output now, Nm, with the sign of positions.
    pub fn load_torque(&self) -> f32 {
        let brake = if self.speed == 0.0 { 0.0 } else { self.load().brake.copysign(self.speed) };
        self.load.at(self.position, self.speed).total() - brake
    }

    /// Phase resistance at the present temperature, Ω.
    pub const fn resistance(&self) -> f32 {
        self.resistance
    }

    /// Sets the windings' temperature, °C.
    pub fn set_temperature(&mut self, celsius: f32) {
        /// Change of the resistance that is not worth a new exponential.
        const SAME: f32 = 1e-5;
        let growth = within(1.0 + COPPER * (celsius - 25.0), 0.1, VAPOUR);
        let resistance = self.config.resistance * growth;
        if (resistance - self.resistance).abs() > SAME * resistance {
            self.resistance = resistance;
            self.set_series(self.series);
        }
    }

    /// Energy in the windings' fields, J.
    pub fn magnetic_energy(&self) -> f32 {
        let Vector { x: id, y: iq } = self.rotor_current();
        0.75 * (self.config.inductance_d * id * id + self.config.inductance_q * iq * iq)
    }

    /// Energy of what turns, and of what springs, weights and the cogging torque hold, J.
    pub fn mechanical_energy(&self) -> f32 {
        let MachineConfig { cogging_torque, cogging_periods, .. } = self.config;
        let periods = f32::from(cogging_periods.max(1));
        let cogging =
            cogging_torque / periods * (1.0 - sin_cos(self.cogging_angle(self.position)).1);
        0.5 * self.shaft.inertia * self.speed * self.speed
            + self.load.potential(self.position)
            + cogging
    }

    /// Stops the current, as open terminals do.
    pub(super) fn open(&mut self) {
        (self.flux, self.current, self.torque) = (Vector::ZERO, Vector::ZERO, 0.0);
    }

    /// Whether nothing changes as long as no current flows.
    pub(super) fn rests(&self) -> bool {
        if self.speed != 0.0 || self.flux != Vector::ZERO {
            return false;
        }
        let load = self.load.at(self.position, 0.0).total();
        let pull = self.load.referred(load) + self.cogging(self.position);
        self.locked || pull.abs() <= self.dry(0.0, load).total
    }

    /// Lets a step pass with open terminals.
    pub(super) fn coast(&mut self, flow: &mut Flow) {
        self.open();
        let half = self.half();
        let end = self.frame.turned(half.turn).turned(half.turn);
        self.advance(half, end, flow);
    }

    /// Lets a voltage act for a step; adds where energy went.
    #[inline]
    pub fn step(&mut self, feed: Feed, flow: &mut Flow) {
        let half = self.half();
        let end = self.frame.turned(half.turn).turned(half.turn);
        let emf = Vector::new(0.0, half.electrical * self.config.flux_linkage);
        // The voltage as the rotor sees it, what of it is constant there, and what is not.
        let (v1, v2, v3, constant, still) = match feed {
            Feed::Stator(v) => {
                let v1 = v.seen_from(self.frame);
                let v2 = v1.seen_from(half.turn);
                (v1, v2, v2.seen_from(half.turn), -emf, self.decay.drive)
            }
            Feed::Rotor(v) => (v, v, v, v - emf, 0.0),
        };
        let gone = self.gone(&half);
        let driven = constant.turned(self.response(&half, gone));
        // What is added is small, and summed first: so the flux linkage keeps its digits.
        let f1 = self.flux;
        let f2 = self.apart(f1, self.decay.outer);
        let f2 = f2 + (driven + v2 * still - f2.turned(gone));
        let f2 = self.apart(f2, self.decay.inner);
        let f3 = self.apart(f2, self.decay.inner);
        let f3 = f3 + (driven + v3 * still - f3.turned(gone));
        let f3 = self.apart(f3, self.decay.outer);
        self.flux = f3;

        let (i1, i2, i3) =
            (f1.scaled(self.inverse), f2.scaled(self.inverse), f3.scaled(self.inverse));
        let sixth = self.period * (1.0 / 6.0);
        let power = v1.dot(i1) + 4.0 * v2.dot(i2) + v3.dot(i3);
        flow.electrical += 1.5 * sixth * power;
        let square = i1.square() + 4.0 * i2.square() + i3.square();
        flow.copper += 1.5 * (self.resistance + self.series) * sixth * square;
        let mut product = self.config.flux_linkage * (i1.y + 4.0 * i2.y + i3.y);
        if self.decay.salient {
            product += f1.cross(i1) + 4.0 * f2.cross(i2) + f3.cross(i3);
        }
        self.torque = 0.25 * self.poles * product;
        self.current = i3.turned(end);
        self.advance(half, end, flow);
    }

    /// What half a step takes away of a flux linkage as it turns back and dies away.
    #[inline]
    fn gone(&self, half: &Half) -> Vector {
        let left = 1.0 - self.decay.gone;
        Vector::new(self.decay.gone + left * half.fallen, left * half.turn.y)
    }

    /// For how long a constant voltage of the rotor's frame acts in half a step, s: a complex number,
    /// because what it did first has turned back since.
    #[inline]
    fn response(&self, half: &Half, gone: Vector) -> Vector {
        if half.electrical == 0.0 {
            return Vector::new(self.decay.drive, 0.0);
        }
        let rate = Vector::new(self.decay.rate, half.electrical);
        gone.seen_from(rate) * (1.0 / rate.square())
    }

    /// A flux linkage after what the axes differ in has acted.
    #[inline]
    fn apart(&self, flux: Vector, shares: Vector) -> Vector {
        if self.decay.salient { flux.grown(shares) } else { flux }
    }

    /// The first half of a step, by the speed and its last change.
    #[inline]
    fn half(&self) -> Half {
        let speed = self.speed + 0.5 * self.change;
        let way = 0.5 * self.period * speed;
        let position = self.position.wrapping_add(digits(way));
        let (turn, fallen) = small(self.poles * way);
        Half { position, speed, electrical: self.poles * speed, way, turn, fallen }
    }

    /// Moves the rotor on, which was foreseen to come to `end`, with the torques of friction and load
    /// as in the middle of the step.
    #[inline]
    fn advance(&mut self, half: Half, end: Vector, flow: &mut Flow) {
        if self.locked {
            // What holds the rotor takes its energy.
            flow.load += 0.5 * self.shaft.inertia * self.speed * self.speed;
            (self.speed, self.change, self.rest) = (0.0, 0.0, 0.0);
            return;
        }
        let MachineConfig { viscous_friction, iron_eddy, iron_hysteresis, .. } = self.config;
        let last = self.speed;
        let load = self.load.at(half.position, half.speed);
        let turning = self.load.referred(load.turning);
        let pull = turning + self.load.referred(load.kept) + self.cogging(half.position);
        let damping = self.load.damping(&load);
        let slower = self.shaft.viscous + self.shaft.gain * damping;
        let gained = self.shaft.gain * (self.torque + pull);
        // A flywheel's speed changes by less than its last digits: what they leave out is kept.
        let pushed = (gained - slower * last) / (1.0 + slower) + self.rest;
        let free = last + pushed;
        let dry = self.dry(half.speed, load.total());
        let held = self.shaft.gain * dry.total;
        let slips = free.abs() > held;
        let change = if slips { pushed - held.copysign(free) } else { -last };
        self.speed = if slips { last + change } else { 0.0 };
        self.change = self.speed - last;
        self.rest = change - self.change;
        let mean = 0.5 * (last + self.speed);
        let way = mean * self.period;
        self.position = self.position.wrapping_add(digits(way));
        self.count = (self.count + 1) % EXACT;
        let missed = (way - 2.0 * half.way) * self.poles;
        self.frame = if self.count == 0 || missed.abs() > NEAR {
            Vector::unit(self.electrical_angle())
        } else {
            end + Vector::new(-end.y, end.x) * missed
        };

        // Each torque times the way is the kinetic energy's change, to the last digit.
        let dry_way = if slips || dry.total == 0.0 {
            way.copysign(free * way)
        } else {
            free * self.shaft.inertia * mean / dry.total
        };
        let slowed = free * way;
        flow.friction += viscous_friction * slowed + dry.rotor * dry_way;
        flow.iron += iron_eddy * slowed + iron_hysteresis * dry_way;
        flow.gear += dry.gear * dry_way;
        flow.load += dry.brake * dry_way + damping * slowed - turning * way;
    }

    /// Torque of the cogging, Nm.
    fn cogging(&self, position: i64) -> f32 {
        if self.config.cogging_torque == 0.0 {
            return 0.0;
        }
        -self.config.cogging_torque * angle::sin(self.cogging_angle(position))
    }

    /// Where a position is in a period of the cogging, 2^32 a period.
    fn cogging_angle(&self, position: i64) -> u32 {
        (position as u32).wrapping_mul(self.config.cogging_periods.into())
    }

    /// Torques that only brake, at a speed and with a load (Nm at the output).
    fn dry(&self, speed: f32, load: f32) -> Dry {
        let MachineConfig { coulomb_friction, stiction, .. } = self.config;
        let relative = speed * self.inverse_stribeck;
        let extra = (stiction - coulomb_friction).max(0.0) / (1.0 + relative * relative);
        let rotor = coulomb_friction + extra;
        let (brake, gear) = self.load.dry(load);
        Dry { rotor, brake, gear, total: rotor + brake + gear + self.config.iron_hysteresis }
    }
}

/// Torques against the motion whatever the speed, at the rotor, Nm.
struct Dry {
    rotor: f32,
    brake: f32,
    gear: f32,
    total: f32,
}

/// The first half of a step.
struct Half {
    /// Where it ends.
    position: i64,
    /// Speed at its end, of the rotor and electrical, rad/s.
    speed: f32,
    electrical: f32,
    /// Angle that the rotor turns in it, rad, as an electrical unit vector, and what that lacks of 1
    /// along the first axis.
    way: f32,
    turn: Vector,
    fallen: f32,
}

/// The unit vector of an angle in rad, which is small but for odd motors, and one less its cosine.
#[inline]
fn small(x: f32) -> (Vector, f32) {
    /// Up to which the series are exact enough, rad.
    const SMALL: f32 = 0.5;
    if x.abs() > SMALL {
        return great(x);
    }
    let z = x * x;
    let fallen = z * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0)));
    (Vector::new(1.0 - fallen, x + x * z * (-1.0 / 6.0 + z * (1.0 / 120.0))), fallen)
}

#[cold]
fn great(x: f32) -> (Vector, f32) {
    let turn = Vector::unit(angle::position(x) as u32);
    (turn, 1.0 - turn.x)
}

/// Electrical angle of a rotor's position, 2^32 a turn.
const fn electrical(position: i64, config: &MachineConfig) -> u32 {
    (position as u32).wrapping_mul(config.pole_pairs as u32)
}

/// Digits of a position in a small angle, rad.
fn digits(radians: f32) -> i64 {
    (radians * (TURN as f32 / core::f32::consts::TAU)) as i64
}
