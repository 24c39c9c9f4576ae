//! Which commands of other computers are obeyed, and when motors stop. It uses no clock and no network
//! itself: the time is an argument, in seconds. After each input, take all [`next`](CommandArbiter::next) outputs.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use motorlink_recording::schema::{JointState, Message as _};

use super::joint::{Joint, Mode, Reference};
use super::rmw_zenoh::{Attachment, Gid};
use super::staleness::{Late, Staleness};
use super::value_cache::ValueCache;

/// The most publishers that are remembered.
const PUBLISHERS: usize = 16;
/// A blocked joint takes commands again when none came for this time, in seconds, or for the time to
/// live if that is longer. A publisher that is held up for less does not undo a stop.
const QUIET: f64 = 1.0;
/// How long the last refusal is shown, in seconds.
const SHOWN: f64 = 5.0;

/// What holds for all commands.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// A motor stops if no command for it comes for this time, in seconds.
    pub time_to_live: f64,
    /// How far the first position may be from the measured one, in rad.
    pub start_within: f64,
    /// Older values are none, in seconds.
    pub fresh: f64,
}

impl Rules {
    fn quiet(&self) -> f64 {
        self.time_to_live.max(QUIET)
    }
}

/// The commands of all joints of a node.
#[derive(Debug)]
pub struct CommandArbiter {
    rules: Rules,
    joints: Vec<Commanded>,
    publishers: BTreeMap<Gid, Staleness>,
    /// Who commands, and when it did last.
    holder: Option<(Gid, f64)>,
    motions: u64,
    outputs: VecDeque<Output>,
    accepted: u64,
    refused: BTreeMap<&'static str, u64>,
    last_refused: Option<(f64, String)>,
}

#[derive(Debug)]
struct Commanded {
    joint: Joint,
    phase: Phase,
    /// Stops whose end is not known. Until then no motion begins: they would end it later.
    stops: u32,
}

#[derive(Debug, Clone, PartialEq)]
enum Phase {
    /// No command has come for the time to live, or none at all.
    Resting,
    /// The last command came at this time.
    Moving { motion: u64, heard: f64 },
    /// It takes no command until none has come for [`Rules::quiet`].
    Blocked { why: String, heard: f64 },
}

impl Phase {
    /// When it ends if no command comes.
    fn end(&self, rules: &Rules) -> Option<f64> {
        match self {
            Phase::Resting => None,
            Phase::Moving { heard, .. } => Some(heard + rules.time_to_live),
            Phase::Blocked { heard, .. } => Some(heard + rules.quiet()),
        }
    }

    fn is_motion(&self, number: u64) -> bool {
        matches!(self, Phase::Moving { motion, .. } if *motion == number)
    }
}

/// What is to be done with a motor.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Send it a command.
    Send(Order),
    /// Stop it, and say with [`CommandArbiter::stopped`] how it went.
    Stop(usize),
}

/// A command for a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Order {
    /// The joint, in the order of the file.
    pub joint: usize,
    /// Orders of one motion have the same number. A stop ends a motion.
    pub motion: u64,
    /// The command.
    pub reference: Reference,
    /// It is not sent later.
    pub until: f64,
}

/// How a joint takes commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CommandStatus<'a> {
    /// The text for people.
    pub words: &'a str,
    /// Whether it takes none for now.
    pub is_blocked: bool,
}

/// Why a sample moves nothing: a kind that is counted, and words.
type Refused = (&'static str, String);

impl CommandArbiter {
    /// CommandArbiter of these joints.
    pub fn new(joints: &[Joint], rules: Rules) -> Self {
        CommandArbiter {
            rules,
            joints: joints
                .iter()
                .map(|joint| Commanded { joint: joint.clone(), phase: Phase::Resting, stops: 0 })
                .collect(),
            publishers: BTreeMap::new(),
            holder: None,
            motions: 0,
            outputs: VecDeque::new(),
            accepted: 0,
            refused: BTreeMap::new(),
            last_refused: None,
        }
    }

    /// A sample has come. It is obeyed as a whole or not at all.
    pub fn receive(
        &mut self,
        now: f64,
        attachment: Option<&[u8]>,
        payload: &[u8],
        readings: &ValueCache,
    ) {
        match self.obey(now, attachment, payload, readings) {
            Ok(()) => self.accepted += 1,
            Err((kind, why)) => {
                *self.refused.entry(kind).or_default() += 1;
                self.last_refused = Some((now, why));
            }
        }
    }

    /// The time has passed. Call it at [`wake`](Self::wake) at the latest.
    pub fn tick(&mut self, now: f64) {
        for number in 0..self.joints.len() {
            let phase = &mut self.joints[number].phase;
            if phase.end(&self.rules).is_some_and(|end| now >= end)
                && let Phase::Moving { .. } = std::mem::replace(phase, Phase::Resting)
            {
                self.stop(number);
            }
        }
    }

    /// When something happens without an input.
    pub fn wake(&self) -> Option<f64> {
        self.joints.iter().filter_map(|it| it.phase.end(&self.rules)).reduce(f64::min)
    }

    /// What is to be done next.
    pub fn next(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// Whether this motion of a joint has neither failed nor ended.
    pub fn goes_on(&self, joint: usize, motion: u64) -> bool {
        self.joints.get(joint).is_some_and(|it| it.phase.is_motion(motion))
    }

    /// A motion failed. With `stops` its motor is stopped.
    pub fn failed(&mut self, now: f64, joint: usize, motion: u64, why: String, stops: bool) {
        if !self.goes_on(joint, motion) {
            return;
        }
        let Commanded { joint: Joint { name, .. }, phase, .. } = &mut self.joints[joint];
        self.last_refused = Some((now, format!("{name}: {why}")));
        *self.refused.entry("failed").or_default() += 1;
        *phase = Phase::Blocked { why, heard: now };
        if stops {
            self.stop(joint);
        }
    }

    fn stop(&mut self, joint: usize) {
        self.joints[joint].stops += 1;
        self.outputs.push_back(Output::Stop(joint));
    }

    /// The motion of a joint ends: its motor has to stop.
    pub fn end_motion(&mut self, now: f64, joint: usize, why: &str) {
        if let Some(Phase::Moving { motion, .. }) = self.joints.get(joint).map(|it| &it.phase) {
            self.failed(now, joint, *motion, why.to_owned(), true);
        }
    }

    /// Somebody stops a motor. Also a joint that rests takes no command: its publisher may be late. A motion
    /// may have begun behind that stop, so it is ended, too.
    pub fn block(&mut self, now: f64, joint: usize, why: &str) {
        self.end_motion(now, joint, why);
        self.joints[joint].phase = Phase::Blocked { why: why.to_owned(), heard: now };
    }

    /// Somebody stops all motors.
    pub fn block_all(&mut self, now: f64, why: &str) {
        (0..self.joints.len()).for_each(|number| self.block(now, number, why));
    }

    /// How a stop went.
    pub fn stopped(&mut self, now: f64, joint: usize, failure: Option<String>) {
        let Some(commanded) = self.joints.get_mut(joint) else { return };
        commanded.stops = commanded.stops.saturating_sub(1);
        if let Some(why) = failure {
            commanded.phase = Phase::Blocked { why, heard: now };
        }
    }

    /// The joints, in the order of their numbers.
    pub fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().map(|it| &it.joint)
    }

    /// How a joint takes commands. `None`: it is read only.
    pub fn phase(&self, name: &str) -> Option<CommandStatus<'_>> {
        let Commanded { joint, phase, stops } =
            self.joints.iter().find(|it| it.joint.name == name)?;
        joint.command?;
        let (words, is_blocked) = match phase {
            Phase::Resting if *stops > 0 => ("stopping", false),
            Phase::Resting => ("at rest", false),
            Phase::Moving { .. } => ("moving", false),
            Phase::Blocked { why, .. } => (why.as_str(), true),
        };
        Some(CommandStatus { words, is_blocked })
    }

    /// Why the last sample was refused, for a while.
    pub fn last_refused(&self, now: f64) -> Option<&str> {
        let (at, why) = self.last_refused.as_ref()?;
        (now - at < SHOWN).then_some(why)
    }

    /// How many samples were obeyed, and how many were refused, by kind.
    pub fn counts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let refused = self.refused.iter().map(|(kind, count)| (*kind, *count));
        std::iter::once(("accepted", self.accepted)).chain(refused)
    }

    fn obey(
        &mut self,
        now: f64,
        attachment: Option<&[u8]>,
        payload: &[u8],
        readings: &ValueCache,
    ) -> Result<(), Refused> {
        let attachment = attachment.and_then(Attachment::decode).ok_or_else(|| {
            let why = "a sample without the attachment of rmw_zenoh 0.2.4 or later";
            ("not_rmw_zenoh", why.to_owned())
        })?;
        let (is_in_time, wanted) = (self.in_time(now, &attachment), self.wanted(payload));
        // While commands come, a blocked joint stays blocked. Late ones count, too. A wrong one counts for all
        // joints.
        for (number, joint) in self.joints.iter_mut().enumerate() {
            let is_meant = wanted.as_ref().map_or(true, |all| all.iter().any(|it| it.0 == number));
            if let (true, Phase::Blocked { heard, .. }) = (is_meant, &mut joint.phase) {
                *heard = now;
            }
        }
        self.tick(now);
        is_in_time?;
        let wanted = wanted?;
        self.hold(now, attachment.gid)?;
        for (number, mode, value) in &wanted {
            self.permit(now, *number, *mode, *value, readings)?;
        }
        let references = wanted.iter().map(|(number, mode, value)| {
            self.joints[*number].joint.reference(*mode, *value).map_err(|why| ("bad_value", why))
        });
        let references: Vec<_> = references.collect::<Result<_, _>>()?;
        for ((joint, ..), reference) in wanted.into_iter().zip(references) {
            let motion = match self.joints[joint].phase {
                Phase::Moving { motion, .. } => motion,
                _ => {
                    self.motions += 1;
                    self.motions
                }
            };
            self.joints[joint].phase = Phase::Moving { motion, heard: now };
            let until = now + self.rules.time_to_live;
            self.outputs.push_back(Output::Send(Order { joint, motion, reference, until }));
        }
        Ok(())
    }

    /// Whether a sample comes when it was sent.
    fn in_time(&mut self, now: f64, sample: &Attachment) -> Result<(), Refused> {
        let time_to_live = self.rules.time_to_live;
        let late = match self.publishers.get_mut(&sample.gid) {
            Some(pace) => match pace.take(now, sample, time_to_live) {
                Ok(()) => return Ok(()),
                Err(late) => late,
            },
            None => {
                if self.publishers.len() == PUBLISHERS {
                    let by_age = |(_, one): &(&Gid, &Staleness), (_, two): &(&Gid, &Staleness)| {
                        one.heard().total_cmp(&two.heard())
                    };
                    let oldest = self.publishers.iter().min_by(by_age).map(|(gid, _)| *gid);
                    oldest.and_then(|gid| self.publishers.remove(&gid));
                }
                self.publishers.insert(sample.gid, Staleness::new(now, sample));
                Late::New
            }
        };
        Err(match late {
            Late::Repeated => ("repeated", "a sample that came before".to_owned()),
            Late::Old(by) => ("old", format!("a sample that waited for {by:.1} s")),
            Late::New => {
                let why = format!(
                    "the publisher is new, or its samples waited somewhere: it is obeyed {time_to_live} s \
                     later"
                );
                ("new_publisher", why)
            }
        })
    }

    /// What a message asks of joints.
    fn wanted(&self, payload: &[u8]) -> Result<Vec<(usize, Mode, f64)>, Refused> {
        let unreadable = || ("unreadable", "a sample that cannot be read as JointState".to_owned());
        let message: JointState = JointState::decode(payload).map_err(|_| unreadable())?;
        let JointState { name: names, position, velocity, effort, .. } = &message;
        let lengths = [position, velocity, effort].map(Vec::len);
        if lengths.into_iter().any(|length| length != 0 && length != names.len()) {
            let [position, velocity, effort] = lengths;
            let why = format!(
                "{} names, {position} positions, {velocity} velocities and {effort} efforts",
                names.len()
            );
            return Err(("bad_lengths", why));
        }
        let mut known = BTreeSet::new();
        let wanted = names.iter().enumerate().map(|(at, name)| {
            let number = self.joints.iter().position(|it| it.joint.name == *name);
            let number = number.ok_or_else(|| ("unknown_joint", format!("no joint {name:?}")))?;
            if !known.insert(number) {
                return Err(("joint_twice", format!("{name} twice in one sample")));
            }
            let Some(mode) = self.joints[number].joint.command else {
                return Err(("read_only_joint", format!("{name} has no command in the file")));
            };
            let (array, what) = match mode {
                Mode::Position => (position, "position"),
                Mode::Velocity => (velocity, "velocity"),
                Mode::Effort => (effort, "effort"),
            };
            let missing = || ("bad_lengths", format!("no {what} for {name}"));
            let value = *array.get(at).ok_or_else(missing)?;
            match value.is_finite() {
                true => Ok((number, mode, value)),
                false => Err(("bad_value", format!("the {what} of {name} is {value}"))),
            }
        });
        wanted.collect()
    }

    /// One publisher commands at a time.
    fn hold(&mut self, now: f64, gid: Gid) -> Result<(), Refused> {
        let is_held =
            |(holder, last): &(Gid, f64)| *holder != gid && now - last < self.rules.time_to_live;
        if self.holder.as_ref().is_some_and(is_held) {
            return Err(("other_publisher", "another publisher commands".to_owned()));
        }
        self.holder = Some((gid, now));
        Ok(())
    }

    /// Whether a joint may be commanded now.
    fn permit(
        &self,
        now: f64,
        number: usize,
        mode: Mode,
        value: f64,
        readings: &ValueCache,
    ) -> Result<(), Refused> {
        let Commanded { joint, phase, stops } = &self.joints[number];
        let name = &joint.name;
        match phase {
            Phase::Moving { .. } => return Ok(()),
            Phase::Blocked { why, .. } => {
                let quiet = self.rules.quiet();
                let why = format!("{name}: {why}; send nothing for {quiet} s, then start");
                return Err(("blocked", why));
            }
            Phase::Resting if *stops > 0 => {
                return Err(("stopping", format!("{name} is still being stopped")));
            }
            Phase::Resting => {}
        }
        if mode != Mode::Position {
            return Ok(());
        }
        let measured =
            readings.fresh(joint, now, self.rules.fresh).and_then(|it| it.position(joint));
        let Some(measured) = measured else {
            return Err(("unknown_position", format!("the position of {name} is not known")));
        };
        let most = self.rules.start_within;
        if (value - measured).abs() > most {
            let why = format!(
                "{name} is at {measured:.3} rad, and the first position is {value:.3} rad: it must be \
                 within {most} rad"
            );
            return Err(("far_start", why));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
