//! From the signals that are wanted to the fewest exchanges.

use std::collections::{BTreeMap, BTreeSet};

use litemap::LiteMap as Map;
use motorlink_proto::rmd::{Code, MotorId};
use motorlink_proto::st::register::Access;
use motorlink_proto::st::{MAX_PAYLOAD, MotorNumber, Profile, RegisterId, SEGMENT_REGISTERS};
use motorlink_proto::time::Micros;

use crate::signal::{Motor, Quantity, Signal, Source};

/// The shortest period that anybody wants of each signal.
pub type Wants = BTreeMap<Signal, Micros>;

/// One exchange that is repeated, and the signals that it reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Poll {
    /// The motor.
    pub motor: Motor,
    /// The time between two exchanges.
    pub period: Micros,
    /// The exchange.
    pub read: Read,
    /// The signals in the reply.
    pub signals: Vec<Signal>,
}

/// A request that reads signals.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Read {
    /// GET_REG.
    Register(RegisterId),
    /// A data segment with these registers.
    Segment(u8, Vec<RegisterId>),
    /// A read command of an RMD motor.
    Command(Code),
    /// Asks whether the replies so far belong to their requests.
    Confirm,
}

/// The polls of an ST drive.
///
/// Registers of a motor with the same period are in one data segment, if the drive has a free one in
/// `segments`. The shortest periods come first. Registers that only a data segment can have always take
/// one. Registers in `alone` share none. Each other register is one exchange.
pub fn st_polls(wants: &Wants, segments: &[u8], alone: &BTreeSet<RegisterId>) -> Vec<Poll> {
    let mut groups: Map<(Micros, MotorNumber), Vec<RegisterId>> = Map::new();
    for (signal, period) in wants {
        if let (Motor::St(motor), Source::Register(register)) = (signal.motor, signal.source) {
            groups.entry((*period, motor)).or_default().push(register);
        }
    }
    let mut free = segments.iter();
    let mut polls = Vec::new();
    for ((period, motor), registers) in groups {
        let (known, unknown): (Vec<_>, Vec<_>) =
            registers.into_iter().partition(|register| register.shape().is_some());
        let poll = |read, registers: &[RegisterId]| {
            let motor = Motor::St(motor);
            let signal = |&register| Signal { motor, source: Source::Register(register) };
            Poll { motor, period, read, signals: registers.iter().map(signal).collect() }
        };
        let (alone, together): (Vec<_>, Vec<_>) =
            known.into_iter().partition(|register| alone.contains(register));
        for registers in chunks(&together).chain(alone.chunks(1)) {
            let pays = registers.len() > 1 || registers.iter().any(|&it| needs_segment(it));
            match free.as_slice() {
                [segment, ..] if pays => {
                    free.next();
                    polls.push(poll(Read::Segment(*segment, registers.to_vec()), registers));
                }
                _ => polls.extend(registers.iter().map(|it| poll(Read::Register(*it), &[*it]))),
            }
        }
        polls.extend(unknown.iter().map(|it| poll(Read::Register(*it), &[*it])));
    }
    polls
}

/// Whether GET_REG refuses the register.
fn needs_segment(register: RegisterId) -> bool {
    register.shape().is_some_and(|shape| shape.access == Access::Dac)
}

/// Registers that fit into one segment each.
fn chunks(mut registers: &[RegisterId]) -> impl Iterator<Item = &[RegisterId]> {
    std::iter::from_fn(move || {
        let mut bytes = 0;
        let fits = |register: &&RegisterId| {
            let shape = register.shape();
            bytes += shape.map_or(0, |shape| usize::from(shape.ty(Profile::Spec).size()));
            bytes <= MAX_PAYLOAD
        };
        let count = registers.iter().take(SEGMENT_REGISTERS).take_while(fits).count();
        let (chunk, rest) = registers.split_at(count);
        registers = rest;
        (count > 0).then_some(chunk)
    })
}

/// The polls of the motors on a CAN bus. A read gives all its values. A value that several reads have
/// is taken from one that is needed anyway.
pub fn rmd_polls(wants: &Wants) -> Vec<Poll> {
    let mut motors: Map<MotorId, Vec<(Quantity, Micros)>> = Map::new();
    for (signal, period) in wants {
        if let (Motor::Rmd(id), Source::Quantity(quantity)) = (signal.motor, signal.source) {
            motors.entry(id).or_default().push((quantity, *period));
        }
    }
    motors.into_iter().flat_map(|(id, quantities)| motor_polls(id, &quantities)).collect()
}

fn motor_polls(id: MotorId, quantities: &[(Quantity, Micros)]) -> Vec<Poll> {
    let codes = |quantity: Quantity| quantity.reads().map(|(code, _)| code);
    let only = quantities.iter().filter(|(quantity, _)| codes(*quantity).count() == 1);
    let needed: Vec<Code> = only.flat_map(|(quantity, _)| codes(*quantity)).collect();
    let motor = Motor::Rmd(id);
    let signal = |quantity| Signal { motor, source: Source::Quantity(quantity) };
    let mut polls: Vec<Poll> = Vec::new();
    for &(quantity, period) in quantities {
        // The first read is the one with the most values.
        let code = codes(quantity).find(|code| needed.contains(code)).or(codes(quantity).next());
        let Some(code) = code else { continue };
        match polls.iter_mut().find(|poll| poll.read == Read::Command(code)) {
            Some(poll) => {
                poll.period = poll.period.min(period);
                poll.signals.push(signal(quantity));
            }
            None => polls.push(Poll {
                motor,
                period,
                read: Read::Command(code),
                signals: vec![signal(quantity)],
            }),
        }
    }
    polls
}

#[cfg(test)]
mod tests {
    use super::*;

    fn none() -> BTreeSet<RegisterId> {
        BTreeSet::new()
    }

    const FAST: Micros = Micros(10_000);
    const SLOW: Micros = Micros(100_000);

    fn wants(motor: Motor, names: &[(&str, Micros)]) -> Wants {
        names.iter().map(|(name, period)| (Signal::named(motor, name).unwrap(), *period)).collect()
    }

    fn rmd(id: u8) -> Motor {
        Motor::Rmd(MotorId::new(id).unwrap())
    }

    fn texts(polls: &[Poll]) -> Vec<String> {
        let text = |poll: &Poll| {
            let names: Vec<_> = poll.signals.iter().map(|it| it.source.to_string()).collect();
            let read = match &poll.read {
                Read::Register(_) => "GET_REG".to_owned(),
                Read::Segment(segment, _) => format!("segment {segment}"),
                Read::Command(code) => format!("{:#04x}", u8::from(*code)),
                Read::Confirm => "confirm".to_owned(),
            };
            format!("{read} {} ms: {}", poll.period.0 / 1000, names.join(" "))
        };
        polls.iter().map(text).collect()
    }

    #[test]
    fn one_exchange_gives_all_values_of_a_reply() {
        let names =
            ["iq_amps", "speed_dps", "encoder", "temperature_celsius"].map(|name| (name, FAST));
        let polls = rmd_polls(&wants(rmd(1), &names));
        assert_eq!(texts(&polls), ["0x9c 10 ms: temperature_celsius iq_amps speed_dps encoder"]);
    }

    #[test]
    fn a_value_of_two_replies_is_taken_from_the_one_that_is_needed() {
        let names = [("temperature_celsius", FAST), ("voltage_volts", SLOW)];
        let polls = rmd_polls(&wants(rmd(1), &names));
        assert_eq!(texts(&polls), ["0x9a 10 ms: temperature_celsius voltage_volts"]);
        let polls = rmd_polls(&wants(rmd(1), &names[..1]));
        assert_eq!(texts(&polls), ["0x9c 10 ms: temperature_celsius"]);
    }

    #[test]
    fn each_motor_has_its_own_polls() {
        let mut both = wants(rmd(1), &[("speed_dps", FAST), ("voltage_volts", SLOW)]);
        both.extend(wants(rmd(2), &[("multi_turn_angle_degrees", SLOW)]));
        let polls = rmd_polls(&both);
        let motors: Vec<_> = polls.iter().map(|poll| poll.motor).collect();
        assert_eq!(motors, [rmd(1), rmd(1), rmd(2)]);
        assert_eq!(
            texts(&polls),
            [
                "0x9c 10 ms: speed_dps",
                "0x9a 100 ms: voltage_volts",
                "0x92 100 ms: multi_turn_angle_degrees"
            ]
        );
    }

    #[test]
    fn registers_with_the_same_period_share_a_segment() {
        let motor = Motor::St(MotorNumber::new(1).unwrap());
        let names = [
            ("SPEED_MEAS", FAST),
            ("I_A", FAST),
            ("BUS_VOLTAGE", SLOW),
            ("HEATS_TEMP", SLOW),
            ("STATUS", SLOW),
        ];
        let wants = wants(motor, &names);
        assert_eq!(
            texts(&st_polls(&wants, &[3, 2], &none())),
            ["segment 3 10 ms: SPEED_MEAS I_A", "segment 2 100 ms: STATUS BUS_VOLTAGE HEATS_TEMP"]
        );
        assert_eq!(
            texts(&st_polls(&wants, &[3], &none())),
            [
                "segment 3 10 ms: SPEED_MEAS I_A",
                "GET_REG 100 ms: STATUS",
                "GET_REG 100 ms: BUS_VOLTAGE",
                "GET_REG 100 ms: HEATS_TEMP"
            ]
        );
        assert_eq!(st_polls(&wants, &[], &none()).len(), 5);
    }

    #[test]
    fn one_register_alone_needs_no_segment_unless_nothing_else_has_it() {
        let motor = Motor::St(MotorNumber::new(1).unwrap());
        assert_eq!(
            texts(&st_polls(&wants(motor, &[("STATUS", FAST)]), &[3], &none())),
            ["GET_REG 10 ms: STATUS"]
        );
        assert_eq!(
            texts(&st_polls(&wants(motor, &[("I_A", FAST)]), &[3], &none())),
            ["segment 3 10 ms: I_A"]
        );
    }

    #[test]
    fn a_segment_has_no_more_than_the_protocol_allows() {
        let motor = Motor::St(MotorNumber::new(1).unwrap());
        let source = |register| Signal { motor, source: Source::Register(register) };
        let wants: Wants = RegisterId::all().map(|register| (source(register), FAST)).collect();
        let polls = st_polls(&wants, &[0, 1, 2, 3], &none());
        let mut sizes = Vec::new();
        for poll in &polls {
            if let Read::Segment(_, registers) = &poll.read {
                let bytes =
                    |it: &RegisterId| usize::from(it.shape().unwrap().ty(Profile::Spec).size());
                assert!(registers.iter().map(bytes).sum::<usize>() <= MAX_PAYLOAD);
                sizes.push(registers.len());
            }
        }
        assert!(sizes.iter().all(|size| *size <= SEGMENT_REGISTERS), "{sizes:?}");
        assert_eq!(sizes.len(), 4);
        assert_eq!(polls.iter().flat_map(|poll| &poll.signals).count(), wants.len());
    }
}
