//! The losses of a gear in all transmitted power, including the acceleration of the load.

use motorlink_sim::plant::{Feed, Flow, GearConfig, LoadConfig, Machine, MachineConfig};
use motorlink_sim::preset;
use motorlink_sim::vector::Vector;

const DT: f32 = 50e-6;

/// The rotor of an RMD-X8 without friction: 2.6e-4 kg m² before 9:1, Kt = 1.5 · 21 · 6.8 mWb.
fn actuator(efficiency: f32, back_efficiency: Option<f32>) -> MachineConfig {
    MachineConfig {
        viscous_friction: 0.0,
        coulomb_friction: 0.0,
        stiction: 0.0,
        cogging_torque: 0.0,
        iron_hysteresis: 0.0,
        iron_eddy: 0.0,
        gear: GearConfig { ratio: 9.0, efficiency, back_efficiency },
        ..preset::rmd_x8().machine
    }
}

/// A machine with a chosen torque current.
struct Driven {
    machine: Machine,
    flow: Flow,
    /// Change of the speed in the last step, rad/s.
    change: f32,
}

impl Driven {
    fn new(config: MachineConfig, load: LoadConfig, speed: f32) -> Self {
        let mut machine = Machine::new(config, load, DT);
        machine.place(0, speed);
        Driven { machine, flow: Flow::default(), change: 0.0 }
    }

    /// Executes a step with a torque current, against the back-EMF in its middle.
    fn step(&mut self, iq: f32) {
        let MachineConfig { pole_pairs, flux_linkage, inductance_q, .. } = *self.machine.config();
        let before = self.machine.speed();
        let electrical = f32::from(pole_pairs) * (before + 0.5 * self.change);
        let ohmic = self.machine.resistance() * iq;
        let induced = Vector::new(-inductance_q * iq, flux_linkage) * electrical;
        self.machine.step(Feed::Rotor(induced + Vector::new(0.0, ohmic)), &mut self.flow);
        self.change = self.machine.speed() - before;
    }

    /// Mean acceleration over 20 ms with a steady current, rad/s².
    fn acceleration(mut self, iq: f32) -> f32 {
        (0..200).for_each(|_| self.step(iq));
        let before = self.machine.speed();
        (0..400).for_each(|_| self.step(iq));
        (self.machine.speed() - before) / (400.0 * DT)
    }
}

#[track_caller]
fn assert_near(found: f32, expected: f32, share: f32) {
    assert!((found / expected - 1.0).abs() < share, "{found}, not {expected}");
}

#[test]
fn a_gear_loses_power_that_accelerates_the_load() {
    // 4 A are 0.8568 Nm; 0.1 kg m² behind 9:1 are 1.2346e-3 kg m² at the rotor.
    let load = LoadConfig { inertia: 0.1, ..LoadConfig::default() };
    for (efficiency, expected) in [
        // 0.8568 / (2.6e-4 + 1.2346e-3 / η)
        (1.0, 573.28),
        (0.92, 534.86),
        (0.6, 369.71),
    ] {
        for direction in [1.0, -1.0] {
            let driven = Driven::new(actuator(efficiency, None), load, 0.0);
            assert_near(driven.acceleration(direction * 4.0), direction * expected, 2e-4);
        }
    }
}

#[test]
fn a_load_that_brakes_drives_the_gear_back() {
    let load = LoadConfig { inertia: 0.1, ..LoadConfig::default() };
    for (back_efficiency, expected) in [
        // -0.8568 / (2.6e-4 + η' 1.2346e-3)
        (Some(0.5), -976.65),
        // A self-locking gear: the rotor stops as without a load.
        (Some(0.0), -3295.4),
        // 2 - 1/0.8 = 0.75
        (None, -722.47),
    ] {
        let driven = Driven::new(actuator(0.8, back_efficiency), load, 300.0);
        assert_near(driven.acceleration(-4.0), expected, 2e-4);
    }
}

#[test]
fn a_load_torque_costs_more_forwards_and_helps_less_backwards() {
    let gear = |torque| {
        let load = LoadConfig { inertia: 0.1, torque, ..LoadConfig::default() };
        Driven::new(actuator(0.8, Some(0.7)), load, 200.0).acceleration(4.0)
    };
    // Against the motion, 4.5 Nm / 9: (0.8568 - 0.5 / 0.8) / (2.6e-4 + 1.2346e-3 / 0.8)
    assert_near(gear(4.5), 128.55, 2e-4);
    // The motor drives a load of 0.1 kg m² more slowly than the load would fall: τ > 0.
    // (0.8568 + 0.5 / 0.8) / (2.6e-4 + 1.2346e-3 / 0.8)
    assert_near(gear(-4.5), 821.76, 2e-4);
    // The load drives the rotor: (0.8568 + 0.7 · 5) / (2.6e-4 + 0.7 · 1.2346e-3)
    assert_near(gear(-45.0), 3875.5, 2e-4);
}

#[test]
fn a_self_locking_gear_holds_its_load_and_others_hold_less() {
    let moves = |efficiency, back_efficiency, torque: f32| {
        let load = LoadConfig { torque, ..LoadConfig::default() };
        let mut machine = Machine::new(actuator(efficiency, back_efficiency), load, DT);
        (0..400).for_each(|_| machine.step(Feed::Stator(Vector::ZERO), &mut Flow::default()));
        machine.speed() != 0.0
    };
    assert!(!moves(0.4, None, 9.0), "2 - 1/0.4 is negative");
    assert!(!moves(0.9, Some(0.0), -9.0));
    assert!(moves(0.9, Some(0.1), -9.0) && moves(0.9, None, 9.0));
}

#[test]
fn a_load_breaks_loose_with_the_torque_that_the_gear_transmits() {
    let stiction = MachineConfig { stiction: 0.05, ..actuator(0.8, Some(0.5)) };
    let moves = |load: LoadConfig| {
        let mut machine = Machine::new(stiction, load, DT);
        (0..400).for_each(|_| machine.step(Feed::Stator(Vector::ZERO), &mut Flow::default()));
        machine.speed() != 0.0
    };
    // Half of T / 9 gets through, against 0.05 Nm: T = 0.9 Nm; a brake of 1 Nm takes 1 Nm of it.
    let pulled = |torque, brake| moves(LoadConfig { torque, brake, ..LoadConfig::default() });
    assert!(!pulled(0.89, 0.0) && pulled(0.91, 0.0) && pulled(-0.91, 0.0));
    assert!(!pulled(1.89, 1.0) && pulled(1.91, 1.0));
}

/// A current of alternating sign, so that the power in the gear changes its direction many times.
#[test]
fn powers_balance_without_chatter_when_the_power_reverses() {
    let load = LoadConfig { inertia: 0.02, viscous: 0.02, brake: 0.3, ..LoadConfig::default() };
    let config =
        MachineConfig { coulomb_friction: 0.02, stiction: 0.03, ..actuator(0.7, Some(0.5)) };
    let mut driven = Driven::new(config, load, 0.0);
    let (mut last, mut kink, mut turns, mut lost) = (0.0f32, 0.0f32, 0, 0.0);
    for step in 0..40_000u32 {
        let phase = f64::from(step) * 4e-3;
        let before = driven.machine.speed();
        driven.step(0.5 + 6.0 * phase.sin() as f32);
        let turned = before * driven.machine.speed() <= 0.0;
        if !turned && last != 0.0 {
            kink = kink.max((driven.change - last).abs());
        }
        turns += u32::from(turned && before != 0.0);
        last = if turned { 0.0 } else { driven.change };
        assert!(driven.flow.gear >= lost - 1e-5, "a gear gives no energy: step {step}");
        lost = driven.flow.gear;
    }
    assert!(turns > 40, "{turns} turns");
    // 6 A change the speed by up to 0.1 rad/s a step, and that little from step to step.
    assert!(kink < 0.003, "{kink} rad/s");
    let Driven { machine, flow, .. } = driven;
    let spent = flow.copper + flow.friction + flow.iron + flow.gear + flow.load;
    let stored = machine.mechanical_energy() + machine.magnetic_energy();
    let missing = (flow.electrical - spent - stored) / flow.electrical;
    assert!(missing.abs() < 0.003, "{missing} of {flow:?}");
    assert!(flow.gear > 1.0, "{flow:?}");
}
