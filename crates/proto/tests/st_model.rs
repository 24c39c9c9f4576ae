//! The slave against its model, byte for byte.

use crate::model::Twins;
use motorlink_proto::st::Profile;
use proptest::prelude::*;

const PROFILES: [Profile; 2] = [Profile::Spec, Profile::Mcsdk54];

#[derive(Debug, Clone)]
enum Step {
    /// A frame with a correct checksum.
    Frame(u8, Vec<u8>),
    /// Any bytes.
    Bytes(Vec<u8>),
    /// Time passes. The slave is polled if the flag is set.
    Wait(u64, bool),
    Overrun,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let payload = || {
        // Ids and phases are small, and few messages have more than nine bytes.
        let usual =
            (0..=0x90u8, prop::collection::vec(any::<u8>(), 0..10)).prop_map(|(id, rest)| {
                let mut bytes = vec![id];
                bytes.extend(rest);
                bytes
            });
        let small = prop::collection::vec(0..=0x90u8, 0..40);
        prop_oneof![6 => usual, 2 => small, 1 => prop::collection::vec(any::<u8>(), 0..=128)]
    };
    let header = (0..=0x13u8, 0..=7u8).prop_map(|(code, motor)| code | motor << 5);
    let known = (header, payload()).prop_map(|(header, payload)| Step::Frame(header, payload));
    let any_frame = (any::<u8>(), payload()).prop_map(|(h, payload)| Step::Frame(h, payload));
    let bytes = prop::collection::vec(any::<u8>(), 0..20).prop_map(Step::Bytes);
    let wait = (0..60_000u64, any::<bool>()).prop_map(|(micros, look)| Step::Wait(micros, look));
    let step =
        prop_oneof![20 => known, 2 => any_frame, 3 => bytes, 3 => wait, 1 => Just(Step::Overrun)];
    prop::collection::vec(step, 1..60)
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn any_sequence_is_answered_as_the_model_does(motors in 1..=7u8, steps in steps()) {
        for profile in PROFILES {
            let mut twins = Twins::new(profile, motors);
            for step in &steps {
                match step {
                    Step::Frame(header, payload) => drop(twins.frame(*header, payload)),
                    Step::Bytes(bytes) => drop(twins.bytes(bytes)),
                    Step::Wait(micros, look) => {
                        twins.wait(*micros);
                        if *look {
                            twins.poll();
                        }
                    }
                    Step::Overrun => twins.overrun(),
                }
            }
        }
    }
}
