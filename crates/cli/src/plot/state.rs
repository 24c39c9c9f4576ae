//! What states look like.

use motorlink_testbench::scenario::{Kind, Names};

use crate::palette::Meaning;

/// What a value with a name means.
pub fn state(kind: Kind, name: &str) -> Meaning {
    match (kind, name) {
        (Kind::Named(Names::Faults | Names::Errors), "none") => Meaning::Rest,
        (Kind::Named(Names::Faults | Names::Errors), _) => Meaning::Fault,
        (_, "IDLE" | "off") => Meaning::Rest,
        (_, "RUN") => Meaning::Running,
        (_, "stopped") => Meaning::Stopping,
        (_, "torque") => Meaning::Torque,
        (_, "speed") => Meaning::Speed,
        (_, "position") => Meaning::Position,
        (_, name) if name.starts_with("FAULT") => Meaning::Fault,
        (_, name) if name.contains("ALIGN") => Meaning::Aligning,
        (_, name) if name.contains("STOP") => Meaning::Stopping,
        _ => Meaning::Starting,
    }
}

#[cfg(test)]
mod tests {
    use motorlink::st::Status;

    use super::*;

    #[test]
    fn states_have_the_meaning_of_their_name() {
        let meaning = |status: Status| state(Kind::Named(Names::Status), &status.to_string());
        assert_eq!(meaning(Status::Run), Meaning::Running);
        assert_eq!(meaning(Status::Alignment), Meaning::Aligning);
        assert_eq!(meaning(Status::AlignOffsetCalib), Meaning::Aligning);
        assert_eq!(meaning(Status::Start), Meaning::Starting);
        assert_eq!(meaning(Status::StopIdle), Meaning::Stopping);
        assert_eq!(meaning(Status::FaultOver), Meaning::Fault);
        assert_eq!(state(Kind::Named(Names::Errors), "none"), Meaning::Rest);
        assert_eq!(state(Kind::Named(Names::Errors), "LOW_VOLTAGE"), Meaning::Fault);
    }
}
