//! What turns: the rotor, and what it drives through the gear.

use super::MachineConfig;
use crate::plant::load::Load;

/// What a step needs of all that turns.
#[derive(Debug, Clone)]
pub(super) struct Shaft {
    /// Inertia of the rotor and of the load, at the rotor, kg m².
    pub(super) inertia: f32,
    /// That of the load alone, per length of a step, Nm s/rad.
    behind: f32,
    /// Friction of the rotor that grows with speed, Nm s/rad.
    viscous: f32,
    /// A gear without loss, and one that power goes through forwards and backwards.
    ideal: Passage,
    forward: Passage,
    backward: Passage,
    /// Whether the gear loses anything.
    lossy: bool,
}

/// What a gear makes of torques while power goes through it one way.
#[derive(Debug, Clone, Copy)]
struct Passage {
    /// Torque at the rotor per torque at the output times the ratio: 1/η forwards, η' backwards.
    share: f32,
    /// Speed per torque of a step, with the inertia that the rotor feels, rad/s/Nm.
    gain: f32,
}

/// Torques of a step at the rotor, Nm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Torques {
    /// What turns the rotor.
    pub(super) rotor: f32,
    /// What brakes the rotor whatever its speed.
    pub(super) dry: f32,
    /// What the load has against growing angles.
    pub(super) load: f32,
    /// What brakes the load whatever its speed.
    pub(super) brake: f32,
    /// What brakes the load per speed, Nm s/rad.
    pub(super) damping: f32,
}

/// What torques do in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    /// Change of the speed, rad/s.
    pub(super) speed: f32,
    /// Direction of the motion: 1 or -1.
    pub(super) direction: f32,
    /// Share of the dry torques that is needed: less than 1 in the step in which they stop the rotor.
    pub(super) dry_share: f32,
    /// Torque at the rotor that the gear loses, Nm.
    pub(super) lost: f32,
}

impl Torques {
    /// The same, seen by a rotor that turns in `direction`.
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

    /// Whether a rotor at rest stays there.
    pub(super) fn rests(&self, torques: &Torques) -> bool {
        [1.0, -1.0].into_iter().all(|direction| {
            let Torques { rotor, dry, load, brake, .. } = torques.along(direction);
            let passed = load + brake;
            rotor - dry <= self.passage(passed).share * passed
        })
    }

    /// What torques do to a rotor with a speed, rad/s; `rest` is added to the change.
    ///
    /// The direction is that of a rotor without dry torques and losses, which never turn it back.
    /// The gear is passed the way that agrees with the torque that it then transmits.
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

    /// Share of the dry torques and of the gear's loss that takes away a speed in a step.
    fn needed(&self, speed: f32, lost: f32, torques: &Torques) -> f32 {
        let dry = torques.dry + torques.brake + lost;
        let slower = self.ideal.gain * (self.viscous + torques.damping);
        if dry > 0.0 { speed * (1.0 + slower) / (self.ideal.gain * dry) } else { 0.0 }
    }

    /// Change of a speed by torques on both sides of the gear; what grows with speed is implicit.
    #[inline]
    fn pushed(&self, passage: &Passage, speed: f32, torques: &Torques) -> f32 {
        let Torques { rotor, dry, load, brake, damping } = *torques;
        let gained = passage.gain * (rotor - dry - passage.share * (load + brake));
        let slower = passage.gain * (self.viscous + passage.share * damping);
        (gained - slower * speed) / (1.0 + slower)
    }

    /// Torque that the gear has to transmit, without its loss, when a speed changes.
    #[inline]
    fn passed(&self, speed: f32, change: f32, torques: &Torques) -> f32 {
        let Torques { load, brake, damping, .. } = *torques;
        self.behind * change + load + brake + damping * (speed + change)
    }

    /// How a torque passes the gear that acts against the motion or, when it is negative, with it.
    fn passage(&self, passed: f32) -> &Passage {
        if passed > 0.0 { &self.forward } else { &self.backward }
    }
}
