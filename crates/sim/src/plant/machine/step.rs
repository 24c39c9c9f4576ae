//! A step of the machine.

use super::shaft::Torques;
use super::{Flow, Machine, MachineConfig};
use crate::angle::{self, TURN};
use crate::control::within;
use crate::plant::{Feed, load};
use crate::vector::Vector;

/// Steps after which rounding has done nothing to the rotor's frame yet.
const EXACT: u8 = 32;

/// Up to which what a step missed of the electrical angle does not stretch the frame, rad.
const NEAR: f32 = 0.01;

/// Speed at which any rotor has burst, rad/s: beyond, numbers lose their digits.
const FASTEST: f32 = 1e5;

impl Machine {
    /// Whether nothing changes as long as no current flows.
    pub(in crate::plant) fn rests(&self) -> bool {
        if self.speed != 0.0 || self.flux != Vector::ZERO || self.voltage != Vector::ZERO {
            return false;
        }
        let load = self.load.at(self.position, 0.0);
        self.locked || self.shaft.rests(&self.torques(self.position, 0.0, &load, 0.0))
    }

    /// Lets a step pass with open terminals.
    pub(in crate::plant) fn coast(&mut self, flow: &mut Flow) {
        self.open();
        let half = self.half();
        let end = self.frame.turned(half.turn).turned(half.turn);
        self.advance(half, end, flow);
        self.voltage = Vector::new(0.0, self.back_emf_amplitude());
    }

    /// Lets a voltage act for a step; adds where energy went.
    #[inline]
    pub fn step(&mut self, feed: Feed, flow: &mut Flow) {
        let half = self.half();
        let end = self.frame.turned(half.turn).turned(half.turn);
        let emf = Vector::new(0.0, half.electrical * self.magnet);
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
        let torques = self.torques(half.position, half.speed, &load, self.torque);
        // A flywheel's speed changes by less than its last digits: what they leave out is kept.
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

        // Each torque times the way is the kinetic energy's change, to the last digit.
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

    /// Torque that brakes the rotor whatever its direction, at a speed, Nm.
    fn dry(&self, speed: f32) -> f32 {
        let MachineConfig { coulomb_friction, stiction, iron_hysteresis, .. } = self.config;
        let relative = speed * self.inverse_stribeck;
        let extra = (stiction - coulomb_friction).max(0.0) / (1.0 + relative * relative);
        coulomb_friction + extra + iron_hysteresis
    }
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

/// Digits of a position in a small angle, rad.
fn digits(radians: f32) -> i64 {
    (radians * (TURN as f32 / core::f32::consts::TAU)) as i64
}
