//! The presets are valid, and invalid values are refused.

use motorlink_sim::plant::{MachineConfig, PlantConfig, SupplyConfig};
use motorlink_sim::preset;
use motorlink_sim::rmd::RmdConfig;
use motorlink_sim::st::MotorConfig;

#[test]
fn every_preset_is_valid() {
    for (name, config) in preset::ALL {
        config().check().unwrap_or_else(|odd| panic!("{name}: {odd}"));
    }
}

#[test]
fn every_drive_that_has_a_name_has_the_plant_of_that_name() {
    let st = MotorConfig::PRESETS.map(|(name, config)| (name, config().plant));
    let rmd = [("rmd-l-5005", RmdConfig::default().plant), ("rmd-x8", RmdConfig::x8().plant)];
    let drives: Vec<_> = st.into_iter().chain(rmd).collect();
    for (name, plant) in &drives {
        assert_eq!(preset::named(name), Some(*plant), "{name}");
    }
    assert_eq!(preset::ALL.len(), drives.len());
}

#[test]
fn an_invalid_value_is_reported() {
    let supply = SupplyConfig { voltage: f32::NAN, ..SupplyConfig::default() };
    let odd = PlantConfig { supply, ..preset::shinano() }.check().unwrap_err();
    assert_eq!(odd.to_string(), "plant.supply.voltage is 0 to 1000, not NaN");
    let odd = PlantConfig { period_us: 60, ..preset::shinano() }.check().unwrap_err();
    assert!(odd.to_string().contains("period_us"), "{odd}");
    let machine = MachineConfig { inductance_d: 1e-6, ..preset::mains().machine };
    let odd = PlantConfig { machine, ..preset::mains() }.check().unwrap_err();
    assert!(odd.to_string().contains("R/2L"), "{odd}");
}
