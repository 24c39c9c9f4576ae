//! The presets are possible, and refused when they are not.

use motorlink_sim::plant::{MachineConfig, PlantConfig, SupplyConfig};
use motorlink_sim::preset;

#[test]
fn every_preset_can_be() {
    for (name, config) in preset::ALL {
        config().check().unwrap_or_else(|odd| panic!("{name}: {odd}"));
    }
}

#[test]
fn what_cannot_be_is_named() {
    let supply = SupplyConfig { voltage: f32::NAN, ..SupplyConfig::default() };
    let odd = PlantConfig { supply, ..preset::shinano() }.check().unwrap_err();
    assert_eq!(odd.to_string(), "plant.supply.voltage is 0 to 1000, not NaN");
    let odd = PlantConfig { period_us: 60, ..preset::shinano() }.check().unwrap_err();
    assert!(odd.to_string().contains("period_us"), "{odd}");
    let machine = MachineConfig { inductance_d: 1e-6, ..preset::mains().machine };
    let odd = PlantConfig { machine, ..preset::mains() }.check().unwrap_err();
    assert!(odd.to_string().contains("R/2L"), "{odd}");
}
