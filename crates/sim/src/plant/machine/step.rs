//! A step of the machine.

use super::shaft::Torques;
use super::{Flow, Machine, MachineConfig};
use crate::angle::{self, TURN};
use crate::control::within;
use crate::plant::{Feed, load};
use crate::vector::Vector;

/// Number of steps in which rounding does not affect the rotor's frame.
const EXACT: u8 = 32;

/// Maximum correction of the electrical angle that does not stretch the frame, rad.
const NEAR: f32 = 0.01;

/// Speed limit, rad/s: any real rotor would burst, and larger numbers lose precision.
const FASTEST: f32 = 1e5;

impl Machine {
    /// Whether the state remains unchanged while no current flows.
    #[inline]
    pub(in crate::plant) fn rests(&mut self) -> bool {
        self.resting = self.resting || self.is_balanced();
        self.resting
    }

    fn is_balanced(&self) -> bool {
        if self.speed != 0.0 || self.flux != Vector::ZERO || self.voltage != Vector::ZERO {
            return false;
        }
        let load = self.load.at(self.position, 0.0);
        self.locked || self.shaft.rests(&self.torques(self.position, 0.0, &load, 0.0))
    }

    /// Executes a step with open terminals.
    pub(in crate::plant) fn coast(&mut self, flow: &mut Flow) {
        self.resting = false;
        self.open();
        let half = self.half();
        let end = self.frame.turned(half.turn).turned(half.turn);
        self.advance(half, end, flow);
        self.voltage = Vector::new(0.0, self.back_emf_amplitude());
    }

    /// Executes a step with a voltage. Adds the energies to `flow`.
    #[inline]
    pub fn step(&mut self, feed: Feed, flow: &mut Flow) {
        self.resting = false;
        let half = self.half();
        let end = self.frame.turned(half.turn).turned(half.turn);
        let emf = Vector::new(0.0, half.electrical * self.magnet);
        // The voltage in the rotor's frame: its constant part, and the rest.
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
        // The added terms are small and are summed first, which keeps the precision of the flux
        // linkage.
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
        flow.copper += self.decay.heating * square;
        let current = i1 + i2 * 4.0 + i3;
        self.voltage = (v1 + v2 * 4.0 + v3 - current * self.series) * (1.0 / 6.0);
        let mut product = self.magnet * current.y;
        if self.decay.salient {
            product += f1.cross(i1) + 4.0 * f2.cross(i2) + f3.cross(i3);
        }
        self.torque = 0.25 * self.poles * product;
        self.current = i3.turned(end);
        self.advance(half, end, flow);
    }

    /// The part of a flux linkage that half a step removes by rotation and decay.
    #[inline]
    fn gone(&self, half: &Half) -> Vector {
        let left = 1.0 - self.decay.gone;
        Vector::new(self.decay.gone + left * half.fallen, left * half.turn.y)
    }

    /// The effective time of a constant voltage of the rotor's frame in half a step, s. It is
    /// complex, because the earlier effect has rotated back.
    #[inline]
    fn response(&self, half: &Half, gone: Vector) -> Vector {
        if half.electrical == 0.0 {
            return Vector::new(self.decay.drive, 0.0);
        }
        let rate = Vector::new(self.decay.rate, half.electrical);
        gone.seen_from(rate) * (1.0 / rate.square())
    }

    /// A flux linkage after the effect of the difference of the axes.
    #[inline]
    fn apart(&self, flux: Vector, shares: Vector) -> Vector {
        if self.decay.salient { flux.grown(shares) } else { flux }
    }

    /// The first half of a step, from the speed and its last change.
    #[inline]
    fn half(&self) -> Half {
        let speed = self.speed + 0.5 * self.change;
        let way = 0.5 * self.period * speed;
        let position = self.position.wrapping_add(digits(way));
        let (turn, fallen) = small(self.poles * way);
        Half { position, speed, electrical: self.poles * speed, way, turn, fallen }
    }

    /// Moves the rotor, whose predicted position is `end`, with the torques of friction and load in
    /// the middle of the step.
    #[inline]
    fn advance(&mut self, half: Half, end: Vector, flow: &mut Flow) {
        if self.locked {
            // The lock absorbs the rotor's energy.
            flow.load += 0.5 * self.shaft.inertia * self.speed * self.speed;
            (self.speed, self.change, self.rest) = (0.0, 0.0, 0.0);
            return;
        }
        let MachineConfig { viscous_friction, iron_eddy, iron_hysteresis, .. } = self.config;
        let last = self.speed;
        let load = self.load.at(half.position, half.speed);
        let torques = self.torques(half.position, half.speed, &load, self.torque);
        // The change of a flywheel's speed is below the precision of the speed, so the rounding
        // error is kept.
        let change = self.shaft.change(last, self.rest, &torques);
        self.speed = within(last + change.speed, -FASTEST, FASTEST);
        self.change = self.speed - last;
        self.rest = within(change.speed - self.change, -1.0, 1.0);
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

        // The sum of each torque times the angle is exactly the change of the kinetic energy.
        let ahead = change.direction * way;
        let dry_way = change.dry_share * ahead;
        let slowed = self.speed * way;
        flow.friction += viscous_friction * slowed + (torques.dry - iron_hysteresis) * dry_way;
        flow.iron += iron_eddy * slowed + iron_hysteresis * dry_way;
        flow.gear += change.lost * ahead;
        flow.load += torques.brake * dry_way
            + torques.damping * slowed
            + self.load.referred(load.constant) * way;
    }

    /// Torques of a step at a position and speed, with that of the currents, Nm.
    fn torques(&self, position: i64, speed: f32, load: &load::Torques, torque: f32) -> Torques {
        Torques {
            rotor: torque + self.cogging(position),
            dry: self.dry(speed),
            load: self.load.referred(load.constant + load.kept),
            brake: self.load.brake(),
            damping: self.load.damping(load),
        }
    }

    /// Torque of the cogging, Nm.
    fn cogging(&self, position: i64) -> f32 {
        if self.config.cogging_torque == 0.0 {
            return 0.0;
        }
        -self.config.cogging_torque * angle::sin(self.cogging_angle(position))
    }

    /// Torque that brakes the rotor in each direction, at a speed, Nm.
    fn dry(&self, speed: f32) -> f32 {
        let MachineConfig { coulomb_friction, iron_hysteresis, .. } = self.config;
        let relative = speed * self.inverse_stribeck;
        let extra = self.extra_stiction / (1.0 + relative * relative);
        coulomb_friction + extra + iron_hysteresis
    }
}

/// The first half of a step.
struct Half {
    /// The position at its end.
    position: i64,
    /// Speed at its end, of the rotor and electrical, rad/s.
    speed: f32,
    electrical: f32,
    /// The rotor's rotation in it, rad; as an electrical unit vector, with the difference of the
    /// first component to 1.
    way: f32,
    turn: Vector,
    fallen: f32,
}

/// The unit vector of an angle in rad, usually small, and 1 minus its cosine.
#[inline]
fn small(x: f32) -> (Vector, f32) {
    /// Up to this angle the series are precise enough, rad.
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

/// Digits of a position in a small angle, rad.
fn digits(radians: f32) -> i64 {
    (radians * (TURN as f32 / core::f32::consts::TAU)) as i64
}
