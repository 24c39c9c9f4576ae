//! Moves within the turn (0xA5, 0xA6) that could be nearly a full turn.

use motorlink_proto::rmd::{MotorId, SpinDirection};
use motorlink_proto::units::TurnCentiDegrees;

use super::Error;

/// What becomes of a move within the turn to a motor that is at its target, or just past it: with the
/// given direction that is nearly a full turn (docs/SPEC-NOTES.md R33).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FullTurn {
    /// The motor is asked for its angle (0x94) first. The move is refused if the motor is at its
    /// target, or past it by `tolerance` at most.
    Refused {
        /// 0.01° a digit.
        tolerance: TurnCentiDegrees,
    },
    /// The move is sent as it is.
    Allowed,
}

impl Default for FullTurn {
    /// Refused, with [`FullTurn::TOLERANCE`].
    fn default() -> Self {
        FullTurn::Refused { tolerance: Self::TOLERANCE }
    }
}

impl FullTurn {
    /// How far past its target a motor is taken to be at it.
    pub const TOLERANCE: TurnCentiDegrees = TurnCentiDegrees(50);

    /// Whether a motor that reads the angle `at` may be moved to `target`. Angles are within the turn,
    /// of the motor shaft, from the motor's zero; those of 360° and more are reduced to one turn.
    ///
    /// # Errors
    /// [`Error::FullTurn`].
    pub fn check(
        self,
        id: MotorId,
        at: TurnCentiDegrees,
        target: TurnCentiDegrees,
        direction: SpinDirection,
    ) -> Result<(), Error> {
        let FullTurn::Refused { tolerance } = self else { return Ok(()) };
        let past = direction.way(target, at);
        if past > tolerance {
            return Ok(());
        }
        Err(Error::FullTurn { motor: id, at, past, target, direction })
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::rmd::FULL_TURN;

    use super::*;

    const CW: SpinDirection = SpinDirection::Clockwise;
    const CCW: SpinDirection = SpinDirection::Counterclockwise;

    fn is_refused(tolerance: u16, at: u16, target: u16, direction: SpinDirection) -> bool {
        let full_turn = FullTurn::Refused { tolerance: TurnCentiDegrees(tolerance) };
        let id = MotorId::new(1).unwrap();
        full_turn.check(id, TurnCentiDegrees(at), TurnCentiDegrees(target), direction).is_err()
    }

    #[test]
    fn a_move_is_refused_at_its_target_and_up_to_the_tolerance_past_it() {
        for target in [0, 20, 9_000, 35_980, 35_999] {
            for past in 0..FULL_TURN.into() {
                let at = |way: i32| (i32::from(target) + way).rem_euclid(FULL_TURN.into()) as u16;
                let refused = past <= 50;
                assert_eq!(is_refused(50, at(past), target, CW), refused, "{target} {past}");
                assert_eq!(is_refused(50, at(-past), target, CCW), refused, "{target} {past}");
            }
        }
    }

    #[test]
    fn a_tolerance_of_0_refuses_at_the_target_only() {
        assert!(is_refused(0, 9_000, 9_000, CW));
        assert!(!is_refused(0, 9_001, 9_000, CW));
    }

    #[test]
    fn the_default_tolerance_is_half_a_degree() {
        let id = MotorId::new(1).unwrap();
        let check = |at| FullTurn::default().check(id, at, TurnCentiDegrees(9_000), CW);
        assert!(check(TurnCentiDegrees::from_degrees(90.5)).is_err());
        assert!(check(TurnCentiDegrees::from_degrees(90.51)).is_ok());
    }

    #[test]
    fn an_angle_beyond_a_turn_is_reduced_to_one() {
        assert!(is_refused(50, 45_002, 9_000, CW));
        assert!(!is_refused(50, 44_998, 9_000, CW));
        assert!(!is_refused(50, u16::MAX, 0, CW));
    }

    #[test]
    fn an_allowed_full_turn_is_never_refused() {
        let id = MotorId::new(1).unwrap();
        let at = TurnCentiDegrees(9_000);
        assert!(FullTurn::Allowed.check(id, at, at, CW).is_ok());
    }
}
