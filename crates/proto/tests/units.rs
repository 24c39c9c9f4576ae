//! A limit in digits never exceeds the given limit.

use motorlink_proto::units::{CentiDegrees, IqCommand, SpeedLimit, inward};
use proptest::prelude::*;

/// Rounding errors of binary fractions, in digits.
const TOLERANCE: f64 = 2e-6;

fn any_scale() -> impl Strategy<Value = f64> {
    let ours = [SpeedLimit::SCALE, IqCommand::SCALE, CentiDegrees::SCALE];
    prop_oneof![
        prop::sample::select(ours.to_vec()),
        // One s16A digit of a drive whose full scale is 0.1 to 500 A.
        (0.1f64..500.0).prop_map(|amps| amps / 32_767.0),
    ]
}

proptest! {
    #[test]
    fn a_limit_is_never_above_what_was_given_and_less_than_a_digit_below(
        digits in 0f64..2_147_483_647.0,
        scale in any_scale(),
    ) {
        let given = digits * scale;
        let allowed = inward(given, scale) as f64 * scale;
        prop_assert!(allowed <= given + TOLERANCE * scale, "{} of {}", allowed, given);
        prop_assert!(allowed > given - scale, "{} of {}", allowed, given);
    }

    #[test]
    fn a_limit_of_whole_digits_keeps_all_of_them(digits in 0i32.., scale in any_scale()) {
        prop_assert_eq!(inward(f64::from(digits) * scale, scale), i64::from(digits));
        prop_assert_eq!(inward(-f64::from(digits) * scale, scale), -i64::from(digits));
    }

    #[test]
    fn a_limit_in_decimals_keeps_all_of_its_digits(hundredths in 0i32..) {
        // Decimal text, such as 0.3 instead of 30 times 0.01.
        let given: f64 = format!("{}.{:02}", hundredths / 100, hundredths % 100).parse().unwrap();
        prop_assert_eq!(inward(given, CentiDegrees::SCALE), i64::from(hundredths));
    }
}

#[test]
fn a_limit_rounds_towards_0() {
    assert_eq!(inward(1.0, IqCommand::SCALE), 62);
    assert_eq!(inward(-1.0, IqCommand::SCALE), -62);
    assert_eq!(inward(0.3, 0.01), 30);
    assert_eq!(inward(0.999, 1.0), 0);
    assert_eq!(inward(f64::NAN, 1.0), 0);
    assert_eq!(inward(f64::INFINITY, 1.0), i64::MAX);
}
