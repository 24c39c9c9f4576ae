//! Positions (0xA3 to 0xA6).

use motorlink_proto::rmd::*;
use motorlink_proto::units::{CentiDegrees, SpeedLimit, TurnCentiDegrees};

use super::case::{Clauses, case, subject};
use super::harness::Harness;
use crate::case::{Case, Need, Stop};
use crate::reading::{R13, R15, R16, R40};

/// Tolerance of a position, 0.01°: a loop without integral part stops early because of friction.
const NEAR: i64 = 200;
/// Maximum overshoot, 0.01°.
const BEYOND: i64 = 1_000;
/// Maximum speed of moves, °/s.
const SLOW: SpeedLimit = SpeedLimit(90);
/// Maximum speed of moves of most of a turn, °/s.
const LONG: SpeedLimit = SpeedLimit(180);
const CLOCKWISE: SpinDirection = SpinDirection::Clockwise;
const COUNTERCLOCKWISE: SpinDirection = SpinDirection::Counterclockwise;

/// Builds a single-turn command.
type Turn = fn(SpinDirection, TurnCentiDegrees) -> [u8; 8];

/// Builds a multi-turn command.
type Move = fn(i32) -> [u8; 8];

const MOVES: [(Code, Move, Clauses, Clauses); 2] = [
    (
        Code::SetPosition,
        |angle| SetPosition { angle: CentiDegrees(angle) }.encode(),
        &["RMD-A3-02", "RMD-A3-01"],
        &["RMD-A3-03"],
    ),
    (
        Code::SetPositionLimited,
        |angle| SetPositionLimited { max_speed: LONG, angle: CentiDegrees(angle) }.encode(),
        &["RMD-A4-02", "RMD-A4-01"],
        &["RMD-A4-03"],
    ),
];

const TURNS: [(Code, Turn, [Clauses; 5]); 2] = [
    (
        Code::SetSingleTurnPosition,
        |direction, angle| SetSingleTurnPosition { direction, angle }.encode(),
        [
            &["RMD-A5-03", "RMD-A5-02", "RMD-A5-01"],
            &["RMD-A5-04", "RMD-A5-02"],
            &["RMD-A5-05"],
            &["RMD-A5-02"],
            &["RMD-A5-04"],
        ],
    ),
    (
        Code::SetSingleTurnPositionLimited,
        |direction, angle| {
            SetSingleTurnPositionLimited { direction, max_speed: LONG, angle }.encode()
        },
        [
            &["RMD-A6-03", "RMD-A6-02", "RMD-A6-01"],
            &["RMD-A6-04", "RMD-A6-02"],
            &["RMD-A6-05"],
            &["RMD-A6-02"],
            &["RMD-A6-04"],
        ],
    ),
];

pub(super) fn cases() -> Vec<Case<Harness>> {
    let mut cases = multi_turn();
    for (code, turn, clauses) in TURNS {
        cases.extend(single_turn(code, turn, clauses));
    }
    cases.push(case("a_turn_takes_the_long_way_if_commanded", &["RMD-A6-04"], |harness| {
        let (_, turn, _) = TURNS[1];
        turns(harness, turn, COUNTERCLOCKWISE, 2_000, -34_000)
    }));
    cases.push(case("the_maximum_speed_of_a_turn_applies", &["RMD-A6-06"], |harness| {
        harness.gently()?;
        let angle = harness.circle(9_000)?;
        let data =
            SetSingleTurnPositionLimited { direction: CLOCKWISE, max_speed: SLOW, angle }.encode();
        no_faster(harness, data)
    }));
    cases.into_iter().map(|case| case.needs(&[Need::Spin])).collect()
}

fn multi_turn() -> Vec<Case<Harness>> {
    let mut cases = Vec::new();
    for (code, command, small, wide) in MOVES {
        let name = subject("a_position_is_reached", code);
        cases.push(case(name, small, move |harness| {
            harness.gently()?;
            let start = harness.angle_in_reach()?;
            moves(harness, command(start + 1_000), start.into(), 1_000)?;
            moves(harness, command(start), i64::from(start) + 1_000, -1_000)
        }));
        let name = subject("a_position_is_reached_the_way_of_the_difference", code);
        cases.push(case(name, wide, move |harness| {
            harness.gently()?;
            let start = harness.angle_in_reach()?;
            moves(harness, command(start + 20_000), start.into(), 20_000)?;
            moves(harness, command(start), i64::from(start) + 20_000, -20_000)
        }));
    }
    cases.push(case("the_maximum_speed_of_a_move_applies", &["RMD-A4-04"], |harness| {
        harness.gently()?;
        let angle = CentiDegrees(harness.angle_in_reach()? + 9_000);
        no_faster(harness, SetPositionLimited { max_speed: SLOW, angle }.encode())
    }));
    let zero =
        case("with_a_maximum_speed_of_0_the_motor_does_not_turn", &["RMD-A4-04"], |harness| {
            harness.gently()?;
            let start = harness.angle()?;
            let angle = CentiDegrees(harness.angle_in_reach()? + 2_000);
            harness.command(SetPositionLimited { max_speed: SpeedLimit(0), angle })?;
            stays(harness, start)
        });
    cases.push(zero.reading(R13));
    cases
}

fn single_turn(code: Code, turn: Turn, clauses: [Clauses; 5]) -> [Case<Harness>; 5] {
    let [clockwise, counterclockwise, again, outside, other] = clauses;
    [
        case(subject("a_turn_goes_clockwise", code), clockwise, move |harness| {
            turns(harness, turn, CLOCKWISE, 2_000, 2_000)
        }),
        case(subject("a_turn_goes_counterclockwise", code), counterclockwise, move |harness| {
            turns(harness, turn, COUNTERCLOCKWISE, -2_000, -2_000)
        }),
        case(subject("repeating_a_turn_starts_no_further_turn", code), again, move |harness| {
            harness.gently()?;
            let (start, angle) = (harness.angle()?, harness.circle(1_500)?);
            moves(harness, turn(CLOCKWISE, angle), start, 1_500)?;
            let there = harness.angle()?;
            harness.ask(turn(CLOCKWISE, angle))?;
            stays(harness, there)
        })
        .reading(R16),
        case(
            subject("an_angle_beyond_the_turn_is_not_carried_out", code),
            outside,
            move |harness| {
                harness.gently()?;
                let start = harness.angle()?;
                for angle in [FULL_TURN, u16::MAX] {
                    harness.ask(turn(CLOCKWISE, TurnCentiDegrees(angle)))?;
                    stays(harness, start)?;
                }
                Ok(())
            },
        )
        .reading(R15),
        case(subject("an_unknown_direction_is_not_carried_out", code), other, move |harness| {
            harness.gently()?;
            let start = harness.angle()?;
            let angle = harness.circle(2_000)?;
            harness.ask(turn(SpinDirection::Unknown(2), angle))?;
            stays(harness, start)
        })
        .reading(R15),
    ]
}

/// A single-turn command to an angle `further` (0.01°) away turns the motor by `by`.
fn turns(
    harness: &mut Harness,
    turn: Turn,
    way: SpinDirection,
    further: i32,
    by: i64,
) -> Result<(), Stop> {
    harness.gently()?;
    let (start, angle) = (harness.angle()?, harness.circle(further)?);
    moves(harness, turn(way, angle), start, by)
}

/// Checks that the command turns the motor from `start` by `by` (0.01°), and in this direction.
fn moves(harness: &mut Harness, command: [u8; 8], start: i64, by: i64) -> Result<(), Stop> {
    harness.ask(command)?;
    let target = start + by;
    let way = start.min(target) - BEYOND..=start.max(target) + BEYOND;
    let mut astray = false;
    let reached = harness.watch(10_000, |seen| {
        astray = !way.contains(&seen.angle);
        astray || ((seen.angle - target).abs() <= NEAR && seen.speed.abs() <= 5)
    })?;
    let (from, to) = (start as f64 / 100.0, target as f64 / 100.0);
    let words =
        format!("a move from {from:.1}° to {to:.1}° (within Max Angle of the vendor's tool)");
    harness.require(reached && !astray, words)
}

/// Checks that the motor does not turn.
fn stays(harness: &mut Harness, start: i64) -> Result<(), Stop> {
    let turned = harness.watch(500, |seen| (seen.angle - start).abs() > NEAR)?;
    harness.require(!turned, format!("no movement from {:.1}°", start as f64 / 100.0))
}

/// Checks that a move by 90° reaches its maximum speed and does not exceed it.
fn no_faster(harness: &mut Harness, command: [u8; 8]) -> Result<(), Stop> {
    let most = SLOW.0 as i16;
    harness.ask(command)?;
    let mut greatest = 0;
    harness.watch(4_000, |seen| {
        greatest = greatest.max(seen.speed.abs());
        greatest > most / 2 && seen.speed.abs() <= 5
    })?;
    let words = format!("a move at {most} °/s, not at {greatest} °/s");
    harness.require(greatest <= most + most / 8 + 3, &*words)?;
    let as_fast = harness.require(greatest >= most / 2, words);
    harness.note(R40, as_fast)
}

impl Harness {
    /// The single-turn angle that is `further` (0.01°) clockwise.
    fn circle(&mut self, further: i32) -> Result<TurnCentiDegrees, Stop> {
        let angle = i32::from(self.read(ReadSingleTurnAngle)?.angle.0) + further;
        Ok(TurnCentiDegrees(angle.rem_euclid(FULL_TURN.into()) as u16))
    }
}
