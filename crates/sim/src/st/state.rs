//! The state machine: the next state, and when it is entered.

use motorlink_proto::st::{RevupPhase, Status};

use super::config::DurationConfig;

/// The inputs of the state machine.
#[derive(Debug, Clone, Copy)]
pub(super) struct Situation<'a> {
    /// Milliseconds in this state, 1 or more.
    pub(super) elapsed: u32,
    pub(super) durations: &'a DurationConfig,
    pub(super) revup: &'a [RevupPhase],
    /// Whether the build has a position sensor that is not aligned.
    pub(super) sensor: bool,
    pub(super) unaligned: bool,
    /// Whether the alignment is part of a start.
    pub(super) starting: bool,
    pub(super) standing: bool,
    /// Whether the cause of a fault is present.
    pub(super) faulty: bool,
}

/// The next state; `None` to remain in this one.
pub(super) fn next(status: Status, now: &Situation<'_>) -> Option<Status> {
    let over = |duration: u16| now.elapsed >= u32::from(duration);
    let durations = now.durations;
    let (done, next) = match status {
        Status::IclWait => (over(durations.inrush_ms), Status::Idle),
        Status::IdleStart if now.unaligned => (true, Status::IdleAlignment),
        Status::IdleStart => (true, Status::ChargeBootCap),
        Status::ChargeBootCap => (over(durations.boot_capacitors_ms), Status::OffsetCalib),
        Status::OffsetCalib => (over(durations.offset_calibration_ms), Status::Clear),
        Status::Clear => (true, Status::Start),
        Status::Start if now.sensor => (true, Status::StartRun),
        Status::Start => (now.elapsed >= revup_duration(now.revup), Status::SwitchOver),
        Status::SwitchOver => (over(durations.switch_over_ms), Status::StartRun),
        Status::StartRun => (true, Status::Run),
        Status::IdleAlignment => (true, Status::AlignChargeBootCap),
        Status::AlignChargeBootCap => {
            (over(durations.boot_capacitors_ms), Status::AlignOffsetCalib)
        }
        Status::AlignOffsetCalib => (over(durations.offset_calibration_ms), Status::AlignClear),
        Status::AlignClear => (true, Status::Alignment),
        Status::Alignment if now.starting => (over(durations.alignment_ms), Status::IdleStart),
        Status::Alignment => (over(durations.alignment_ms), Status::AnyStop),
        Status::AnyStop => (true, Status::Stop),
        Status::Stop => (true, Status::WaitStopMotor),
        Status::WaitStopMotor => (now.standing, Status::StopIdle),
        Status::StopIdle => (true, Status::Idle),
        Status::FaultNow => (!now.faulty, Status::FaultOver),
        Status::FaultOver => (now.faulty, Status::FaultNow),
        Status::Idle | Status::Run | Status::Unknown(_) => return None,
    };
    done.then_some(next)
}

/// Whether a stop has an effect in this state: in RUN and alignment, and in the states before them.
pub(super) fn stoppable(status: Status) -> bool {
    use Status::*;
    let starting = matches!(status, IdleStart | ChargeBootCap | OffsetCalib | Clear | Start);
    let aligning = matches!(
        status,
        IdleAlignment | AlignChargeBootCap | AlignOffsetCalib | AlignClear | Alignment
    );
    starting || aligning || matches!(status, SwitchOver | StartRun | Run)
}

/// Length of the rev-up, ms.
fn revup_duration(phases: &[RevupPhase]) -> u32 {
    phases.iter().map(|phase| u32::from(phase.duration_ms)).sum()
}

/// Speed (rpm) and current (s16A) of the rev-up after `elapsed` ms: straight lines from phase to
/// phase, from 0.
pub(super) fn revup(phases: &[RevupPhase], elapsed: u32) -> (f32, f32) {
    let (mut speed, mut current, mut begin) = (0.0, 0.0, 0);
    for phase in phases {
        let (last_speed, last_current) = (speed, current);
        (speed, current) = (phase.speed_rpm as f32, f32::from(phase.torque_s16a));
        let duration = u32::from(phase.duration_ms);
        if elapsed < begin + duration {
            let share = (elapsed - begin) as f32 / duration as f32;
            return (
                last_speed + (speed - last_speed) * share,
                last_current + (current - last_current) * share,
            );
        }
        begin += duration;
    }
    (speed, current)
}
