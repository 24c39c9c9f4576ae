//! The rotor, and the load that it drives through the gear.

use super::MachineConfig;
use crate::plant::load::Load;

/// The values of rotor and load for a step.
#[derive(Debug, Clone)]
pub(super) struct Shaft {
    /// Inertia of the rotor and of the load, at the rotor, kg m².
    pub(super) inertia: f32,
    /// That of the load alone, divided by the length of a step, Nm s/rad.
    behind: f32,
    /// Friction of the rotor that grows with speed, Nm s/rad.
    viscous: f32,
    /// A gear without loss, one with power transmitted forwards, and one with power transmitted
    /// backwards.
    ideal: Passage,
    forward: Passage,
    backward: Passage,
    /// Whether the gear has losses.
    lossy: bool,
}

/// The effect of a gear on torques, for one direction of the power.
#[derive(Debug, Clone, Copy)]
struct Passage {
    /// Torque at the rotor per torque at the output times the ratio: 1/η forwards, η' backwards.
    share: f32,
    /// Speed change per torque in a step, with the effective inertia at the rotor, rad/s/Nm.
    gain: f32,
}

/// Torques of a step at the rotor, Nm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Torques {
    /// The torque that turns the rotor.
    pub(super) rotor: f32,
    /// The torque that brakes the rotor at any speed.
    pub(super) dry: f32,
    /// The torque of the load against growing angles.
    pub(super) load: f32,
    /// The torque that brakes the load at any speed.
    pub(super) brake: f32,
    /// The braking torque of the load per speed, Nm s/rad.
    pub(super) damping: f32,
}

/// The effect of torques in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    /// Change of the speed, rad/s.
    pub(super) speed: f32,
    /// Direction of the motion: 1 or -1.
    pub(super) direction: f32,
    /// Used fraction of the dry torques: less than 1 in the step in which they stop the rotor.
    pub(super) dry_share: f32,
    /// Torque at the rotor lost in the gear, Nm.
    pub(super) lost: f32,
}

impl Torques {
    /// The same torques for a rotor that turns in `direction`.
    fn along(&self, direction: f32) -> Self {
        Torques { rotor: direction * self.rotor, load: direction * self.load, ..*self }
    }
}

impl Shaft {
    pub(super) fn new(config: &MachineConfig, load: &Load, period: f32) -> Self {
        let behind = load.inertia();
        let passage = |share| Passage { share, gain: period / (config.inertia + share * behind) };
        let gear = config.gear;
        Shaft {
            inertia: config.inertia + behind,
            behind: behind / period,
            viscous: config.viscous_friction + config.iron_eddy,
            ideal: passage(1.0),
            forward: passage(1.0 / gear.efficiency),
            backward: passage(gear.back_efficiency()),
            lossy: gear.efficiency < 1.0 || gear.back_efficiency() < 1.0,
        }
    }

    /// Whether a rotor at rest remains at rest.
    pub(super) fn rests(&self, torques: &Torques) -> bool {
        [1.0, -1.0].into_iter().all(|direction| {
            let Torques { rotor, dry, load, brake, .. } = torques.along(direction);
            let passed = load + brake;
            rotor - dry <= self.passage(passed).share * passed
        })
    }

    /// The effect of torques on a rotor with a speed, rad/s. `rest` is added to the change.
    ///
    /// The direction is that of a rotor without dry torques and losses, because these never reverse
    /// it. The direction of the power agrees with the torque that the gear then transmits.
    #[inline]
    pub(super) fn change(&self, speed: f32, rest: f32, torques: &Torques) -> Change {
        let frictionless = Torques { dry: 0.0, brake: 0.0, ..*torques };
        let free = speed + self.pushed(&self.ideal, speed, &frictionless) + rest;
        let direction = 1f32.copysign(free);
        let ahead = torques.along(direction);
        let (speed, rest) = (direction * speed, direction * rest);
        let pushed = |passage| self.pushed(passage, speed, &ahead) + rest;
        let (mut passage, mut change);
        if self.lossy {
            (passage, change) = (&self.forward, pushed(&self.forward));
            if self.passed(speed, change, &ahead) < 0.0 {
                (passage, change) = (&self.backward, pushed(&self.backward));
            }
        } else {
            (passage, change) = (&self.ideal, pushed(&self.ideal));
        }
        let slips = speed + change > 0.0;
        if !slips {
            change = -speed;
            passage = self.passage(self.passed(speed, change, &ahead));
        }
        let lost = if self.lossy {
            (passage.share - 1.0) * self.passed(speed, change, &ahead)
        } else {
            0.0
        };
        let dry_share = if slips { 1.0 } else { self.needed(free.abs(), lost, &ahead) };
        Change { speed: direction * change, direction, dry_share, lost: dry_share * lost }
    }

    /// Fraction of the dry torques and of the gear's loss that stops a speed in a step.
    fn needed(&self, speed: f32, lost: f32, torques: &Torques) -> f32 {
        let dry = torques.dry + torques.brake + lost;
        let slower = self.ideal.gain * (self.viscous + torques.damping);
        if dry > 0.0 { speed * (1.0 + slower) / (self.ideal.gain * dry) } else { 0.0 }
    }

    /// Change of a speed by torques on both sides of the gear. Torques that grow with speed are
    /// implicit.
    #[inline]
    fn pushed(&self, passage: &Passage, speed: f32, torques: &Torques) -> f32 {
        let Torques { rotor, dry, load, brake, damping } = *torques;
        let gained = passage.gain * (rotor - dry - passage.share * (load + brake));
        let slower = passage.gain * (self.viscous + passage.share * damping);
        (gained - slower * speed) / (1.0 + slower)
    }

    /// Torque that the gear must transmit for a change of speed, without its loss.
    #[inline]
    fn passed(&self, speed: f32, change: f32, torques: &Torques) -> f32 {
        let Torques { load, brake, damping, .. } = *torques;
        self.behind * change + load + brake + damping * (speed + change)
    }

    /// The gear's effect for a transmitted torque: positive against the motion, negative with it.
    fn passage(&self, passed: f32) -> &Passage {
        if passed > 0.0 { &self.forward } else { &self.backward }
    }
}
