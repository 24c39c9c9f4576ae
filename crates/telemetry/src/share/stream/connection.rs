//! The connection of a program that follows signals of a line.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;

use litemap::LiteMap as Map;
use motorlink_proto::st::Profile;

use super::subscription::{Followed, Item, Wanted};
use crate::share::VERSION;
use crate::share::client_codec::{ClientCodec, Ended, Heard};
use crate::share::clock::Clock;
use crate::share::data::{Data, TIMES};
use crate::share::message::{Answer, Ask, DropRule, Group, LONGEST_QUEUE, Line, SignalName, Text};
use crate::signal::{Motor, Signal};

/// A share that is silent for this time after a question is stopped, in ns.
const SILENCE: u64 = 2_000_000_000;
/// The same before it has answered the first questions: many programs may come at this moment.
const OPENING: u64 = 10_000_000_000;
/// The most bytes that are taken at once. A share that sends more is read on at the next call.
const AT_ONCE: usize = 4 << 20;
/// How much the clock of the share must change to be told again, in seconds.
const WORTH_TELLING: f64 = 0.005;

#[derive(Debug)]
pub(super) struct Connection {
    pub(super) socket: UnixStream,
    codec: ClientCodec,
    /// Requests without an answer, and when they were sent.
    pending: Map<u32, (Asked, u64)>,
    /// When bytes came, or when it was connected.
    heard: u64,
    clock: Option<Clock>,
    /// How far the clock of the share was ahead when that was told last, in seconds.
    told: Option<f64>,
    /// Whether it has answered the first questions.
    has_begun: bool,
    /// When it fell silent, until what waited has come.
    silent: Option<u64>,
    /// Which of the wanted signals each subscription has.
    pub(super) subscriptions: Map<u32, usize>,
    groups: Map<u32, Columns>,
    /// Why the share closes it.
    closing: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Hello,
    Lines,
    Subscribe(usize),
    Rates,
    Last,
}

/// Where the values of a group go.
#[derive(Debug)]
struct Columns {
    wanted: usize,
    motor: Motor,
    /// The column of each signal of the motor.
    of: Vec<Option<usize>>,
}

impl Connection {
    /// Asks for everything at once.
    pub(super) fn begin(socket: UnixStream, followed: &Followed, now: u64) -> Result<Self, String> {
        let (pending, subscriptions, groups) = (Map::new(), Map::new(), Map::new());
        let codec = ClientCodec::default();
        let (clock, told, silent, closing) = (None, None, None, None);
        let mut begun = Connection {
            socket,
            codec,
            pending,
            heard: now,
            clock,
            told,
            has_begun: false,
            silent,
            subscriptions,
            groups,
            closing,
        };
        let hello = Ask::Hello { protocol: VERSION, name: followed.name.clone() };
        begun.ask(Asked::Hello, hello, now)?;
        begun.ask(Asked::Lines, Ask::Lines, now)?;
        for (number, Wanted { signals, period }) in followed.wanted.iter().enumerate() {
            let name = |signal: &Signal| SignalName::of(&followed.line, *signal);
            let ask = Ask::Subscribe {
                signals: signals.iter().map(name).collect(),
                period: *period,
                queue: LONGEST_QUEUE,
                drop: DropRule::Newest,
                rows: true,
            };
            begun.ask(Asked::Subscribe(number), ask, now)?;
        }
        begun.socket.set_nonblocking(true).map_err(|error| error.to_string())?;
        Ok(begun)
    }

    /// Asks for the rates and the clocks, unless it has not answered the last question.
    pub(super) fn ask_rates(&mut self, followed: &Followed, now: u64) {
        if self.pending.is_empty() {
            // A connection that is lost is noticed when it is read.
            let rates = Ask::Rates { line: Some(followed.line.clone()) };
            let _ = self.ask(Asked::Rates, rates, now);
            let _ = self.ask(Asked::Lines, Ask::Lines, now);
        }
    }

    /// Asks for something, to know when all that the share has said until now has come.
    pub(super) fn ask_last(&mut self, now: u64) {
        // A connection that is lost is noticed when it is read.
        let _ = self.ask(Asked::Last, Ask::Lines, now);
    }

    /// Whether [`ask_last`](Self::ask_last) has no answer.
    pub(super) fn awaits_last(&self) -> bool {
        self.pending.values().any(|(asked, _)| *asked == Asked::Last)
    }

    fn ask(&mut self, asked: Asked, ask: Ask, now: u64) -> Result<(), String> {
        let (id, bytes) = self.codec.request(ask).map_err(|error| error.to_string())?;
        self.socket.write_all(&bytes).map_err(|error| error.to_string())?;
        self.pending.insert(id, (asked, now));
        Ok(())
    }

    /// Whether a request has had no answer, and nothing else came, for too long.
    pub(super) fn is_silent(&mut self, now: u64) -> bool {
        let oldest = self.pending.values().map(|(_, sent)| *sent).min();
        let limit = if self.has_begun { SILENCE } else { OPENING };
        let is_silent = oldest.is_some_and(|sent| now.saturating_sub(sent.max(self.heard)) > limit);
        if is_silent {
            self.silent.get_or_insert(self.heard);
        }
        is_silent
    }

    /// Takes what came; whether something did.
    pub(super) fn receive(
        &mut self,
        followed: &Followed,
        now: u64,
        items: &mut VecDeque<Item>,
    ) -> Result<bool, String> {
        let (mut bytes, mut taken) = ([0; 16 << 10], 0);
        while taken < AT_ONCE {
            let size = match self.socket.read(&mut bytes) {
                Ok(0) => return Err(self.gone()),
                Ok(size) => size,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(_) => return Err(self.gone()),
            };
            (taken, self.heard) = (taken + size, now);
            self.codec.push(&bytes[..size]);
            while let Some(heard) = self.codec.hear().map_err(|error| error.to_string())? {
                self.heard(heard, followed, now, items)?;
            }
        }
        Ok(taken > 0)
    }

    fn gone(&mut self) -> String {
        match self.closing.take() {
            Some(why) => format!("the share closed the connection: {why}"),
            None => "the share is gone".to_owned(),
        }
    }

    fn heard(
        &mut self,
        heard: Heard,
        followed: &Followed,
        now: u64,
        items: &mut VecDeque<Item>,
    ) -> Result<(), String> {
        match heard {
            Heard::Ended(ended) => return self.ended(ended, followed, now, items),
            Heard::Data(data) => self.rows(&data, now, items),
            Heard::Text(Text::Group(group)) => self.group(&group, followed),
            Heard::Text(Text::Unconfirmed { rows, .. }) => items.push_back(Item::Unconfirmed(rows)),
            Heard::Text(Text::Missed { events }) => items.push_back(Item::Lost(events)),
            Heard::Text(Text::Closing { message }) => self.closing = Some(message),
            Heard::Text(Text::Event(event)) => {
                if event.line.as_ref().is_none_or(|line| *line == followed.line) {
                    let time = self.clock.map_or(now, |clock| clock.of_event(&event));
                    items.push_back(Item::Event(time, event));
                }
            }
            Heard::Text(_) => {}
        }
        Ok(())
    }

    fn ended(
        &mut self,
        Ended { id, result }: Ended,
        followed: &Followed,
        now: u64,
        items: &mut VecDeque<Item>,
    ) -> Result<(), String> {
        let Some((asked, sent)) = self.pending.remove(&id) else { return Ok(()) };
        let is_again = self.is_again(asked);
        self.has_begun |= self.pending.is_empty();
        let answer = match result {
            Ok(answer) => answer,
            // The question was too old. The next one is not.
            Err(_) if is_again => return Ok(()),
            Err(refusal) => return Err(refusal.message),
        };
        match (asked, answer) {
            (Asked::Lines, Answer::Lines { lines, .. }) => {
                let line = line(&lines, followed)?;
                let clock = match self.clock {
                    Some(clock) => clock.corrected(line, sent, now),
                    None => Clock::new(line, sent, now),
                };
                self.clock = Some(clock);
                let (ahead, within) = clock.ahead();
                if (ahead - self.told.unwrap_or_default()).abs() > WORTH_TELLING.max(within) {
                    self.told = Some(ahead);
                    items.push_back(Item::Clock { ahead, within });
                }
            }
            (Asked::Subscribe(number), Answer::Subscribe { subscription }) => {
                self.subscriptions.insert(subscription, number);
            }
            (Asked::Rates, Answer::Rates { rates }) => items.push_back(Item::Rates(rates)),
            (Asked::Hello, Answer::Hello { .. }) | (Asked::Last, Answer::Lines { .. }) => {}
            _ => return Err("nothing answers like a share".to_owned()),
        }
        Ok(())
    }

    /// Whether it is asked again and again.
    fn is_again(&self, asked: Asked) -> bool {
        match asked {
            Asked::Rates | Asked::Last => true,
            Asked::Lines => self.clock.is_some(),
            Asked::Hello | Asked::Subscribe(_) => false,
        }
    }

    fn group(&mut self, group: &Group, followed: &Followed) {
        let Some(wanted) = self.subscriptions.get(&group.subscription) else { return };
        let signals = &followed.wanted[*wanted].signals;
        let mut of_motor = signals.iter().filter(|it| it.motor.number() == group.motor).peekable();
        let Some(motor) = of_motor.peek().map(|signal| signal.motor) else { return };
        let column = |signal: &Signal| {
            let name = signal.source.to_string();
            group.columns.iter().position(|column| column.name == name)
        };
        let of = of_motor.map(column).collect();
        self.groups.insert(group.group, Columns { wanted: *wanted, motor, of });
    }

    fn rows(&mut self, data: &Data, now: u64, items: &mut VecDeque<Item>) {
        if data.lost > 0 {
            items.push_back(Item::Lost(data.lost.into()));
        }
        let Some(Columns { wanted, motor, of }) = self.groups.get(&data.group) else { return };
        let Some(clock) = self.clock else { return };
        let value = |column: usize, row: usize| {
            let column = data.columns.get(column);
            column.and_then(|column| column.get(row)).copied().unwrap_or(f64::NAN)
        };
        if let Some(since) = self.silent.take() {
            let is_late = clock.own(data.t0 + value(0, 0)) + SILENCE / 2 < now;
            items.extend(is_late.then_some(Item::Late(since)));
        }
        for row in 0..data.rows() {
            items.push_back(Item::Row {
                wanted: *wanted,
                motor: *motor,
                time: clock.own(data.t0 + value(0, row)),
                span: value(1, row),
                values: of
                    .iter()
                    .map(|at| at.map_or(f64::NAN, |at| value(TIMES + at, row)))
                    .collect(),
            });
        }
    }
}

/// The line, if its drives speak what they spoke before.
fn line<'a>(lines: &'a [Line], followed: &Followed) -> Result<&'a Line, String> {
    let line = lines.iter().find(|line| line.line == followed.line);
    let line = line.ok_or_else(|| format!("the share has no line {}", followed.line))?;
    let is_known = |profile: Profile| line.profile.as_deref() == Some(profile.name());
    let has_profile = followed.speaks.profile().is_none_or(is_known);
    match has_profile && line.protocol == followed.speaks.protocol() {
        true => Ok(line),
        false => Err(format!("{} of the share has another protocol or profile", followed.line)),
    }
}
