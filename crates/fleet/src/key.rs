//! The keys of a node. They begin with `motorlink/v1/NODE`.

use std::fmt;
use std::str::FromStr;

use rustix::rand::{GetRandomFlags, getrandom};

/// The beginning of all keys.
pub const ROOT: &str = "motorlink/v1";
/// In the place of a line's name: what is about the whole node.
const WHOLE: &str = "node";
/// The longest name of a node or a program, in bytes.
pub const LONGEST: usize = 40;

/// The name of a node, of its run, of a user or of a session: a part of keys.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Name(String);

/// Random bytes.
fn random<const N: usize>() -> std::io::Result<[u8; N]> {
    let mut bytes = [0; N];
    getrandom(&mut bytes, GetRandomFlags::empty())?;
    Ok(bytes)
}

impl Name {
    /// 16 random hexadecimal digits.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn random() -> std::io::Result<Self> {
        Ok(Name(format!("{:016x}", u64::from_ne_bytes(random()?))))
    }

    /// A run of a node on this computer: 8 digits of the computer, then 8 random ones.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn run(computer: u32) -> std::io::Result<Self> {
        Ok(Name(format!("{computer:08x}{:08x}", u32::from_ne_bytes(random()?))))
    }

    /// Whether two runs were on the same computer.
    pub(crate) fn is_of_computer_of(&self, other: &Name) -> bool {
        self.0.get(..8) == other.0.get(..8)
    }

    /// The name of one of several nodes that have this name, by its run.
    pub fn of_run(&self, run: &Name) -> Self {
        let (name, run) = (&self.0, &run.0);
        let [name, run] =
            [&name[..name.len().min(LONGEST - 9)], &run[run.len().saturating_sub(4)..]];
        Name(format!("{name}.run-{run}"))
    }

    /// In the place of a name: all of them.
    pub(crate) fn any() -> Self {
        Name("*".to_owned())
    }
}

/// A text that cannot be a name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "a name has 1 to {LONGEST} letters, digits, `-`, `_` and `.`, and begins with a letter, a digit or `_`"
)]
pub struct BadName;

impl Name {
    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The nearest name to a text.
    pub fn near(text: &str) -> Self {
        let known: String =
            text.chars().map(|it| if is_allowed(it) { it } else { '-' }).take(LONGEST).collect();
        known.trim_start_matches(['-', '.']).parse().unwrap_or_else(|_| Name("unnamed".to_owned()))
    }
}

fn is_allowed(character: char) -> bool {
    character.is_ascii_alphanumeric() || matches!(character, '-' | '_' | '.')
}

impl FromStr for Name {
    type Err = BadName;

    fn from_str(text: &str) -> Result<Self, BadName> {
        // Names are options of commands and parts of paths, too.
        let is_name = (1..=LONGEST).contains(&text.len())
            && text.chars().all(is_allowed)
            && !text.starts_with(['-', '.']);
        if is_name { Ok(Name(text.to_owned())) } else { Err(BadName) }
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// What a program may want of a node. Each is a part of keys, so that access control can tell them apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// To read values and events.
    See,
    /// To stop motors and to latch.
    Stop,
    /// Everything else.
    Act,
}

impl Scope {
    /// All of them.
    pub const ALL: [Self; 3] = [Scope::See, Scope::Stop, Scope::Act];

    /// The part of keys.
    pub const fn word(self) -> &'static str {
        match self {
            Scope::See => "see",
            Scope::Stop => "stop",
            Scope::Act => "act",
        }
    }
}

/// All that a node says.
pub(crate) fn all_of(node: &Name) -> String {
    format!("{ROOT}/{node}/**")
}

/// That a node is there, and its run: a liveliness token.
pub fn alive(node: &Name, boot: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/alive/{boot}")
}

/// Those of all nodes with a name. There should be one.
pub fn alive_of(node: &Name) -> String {
    alive(node, &Name::any())
}

/// Those of all nodes.
pub fn all_alive() -> String {
    alive_of(&Name::any())
}

/// That a run of a node ends, with its motors stopped.
pub fn ended(node: &Name, boot: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/ended/{boot}")
}

/// What a node says of itself: a query.
pub fn info(node: &Name, boot: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/info/{boot}")
}

/// The requests of a program: queries.
pub fn ask(node: &Name, boot: &Name, scope: Scope, who: &Name, session: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/ask/{boot}/{}/{who}/{session}", scope.word())
}

/// The requests of all programs.
pub fn all_asks(node: &Name, boot: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/ask/{boot}/*/*/*")
}

/// That a program is there: a liveliness token.
pub fn session_token(node: &Name, boot: &Name, who: &Name, session: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/here/{boot}/{who}/{session}")
}

/// Events of the node, or of a line.
pub fn events(node: &Name, line: Option<&str>) -> String {
    format!("{ROOT}/{node}/{}/events", line.unwrap_or(WHOLE))
}

/// The lines of a node and their state.
pub fn state(node: &Name) -> String {
    format!("{ROOT}/{node}/{WHOLE}/state")
}

/// The samples of a motor.
pub const SAMPLES: &str = "samples";
/// The columns of the samples of a motor: a query.
pub const COLUMNS: &str = "columns";

/// What programs ask of a motor without a session: queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotorQuery {
    /// What the drive is.
    Identity,
    /// The values of registers.
    Registers,
    /// The file of its settings.
    Settings,
}

impl MotorQuery {
    /// All of them.
    pub const ALL: [Self; 3] = [MotorQuery::Identity, MotorQuery::Registers, MotorQuery::Settings];

    /// The part of keys behind the motor.
    pub const fn words(self) -> &'static str {
        match self {
            MotorQuery::Identity => "identity",
            MotorQuery::Registers => "registers/*",
            MotorQuery::Settings => "settings",
        }
    }
}

/// A key of a motor: [`SAMPLES`], [`COLUMNS`], or the words of a query. That of registers is about all that can
/// be read.
pub fn of_motor(node: &Name, line: &str, motor: u8, words: &str) -> String {
    format!("{ROOT}/{node}/{line}/{motor}/{words}")
}

/// Those of all motors of a node.
pub(crate) fn of_all_motors(node: &Name, words: &str) -> String {
    format!("{ROOT}/{node}/*/*/{words}")
}

/// A register of a motor: a query. It has this key in the answer to a query about all of them, too.
pub fn register(node: &Name, line: &str, motor: u8, name: &str) -> String {
    of_motor(node, line, motor, &format!("registers/{name}"))
}

/// The line and the motor in the key of a query, if it names one motor of one node.
pub(crate) fn one_motor(key: &str) -> Option<(&str, &str)> {
    let mut parts = key.strip_prefix(ROOT)?.strip_prefix('/')?.split('/');
    let mut part = || parts.next().filter(|part| !part.contains('*'));
    let (_node, line, motor, _about) = (part()?, part()?, part()?, part()?);
    Some((line, motor))
}

/// The register in the key of a query, if it names one of one motor.
pub(crate) fn one_register(key: &str) -> Option<&str> {
    one_motor(key)?;
    key.rsplit('/').next().filter(|name| !name.contains('*'))
}

/// The node of any key.
pub fn node_of(key: &str) -> Option<Name> {
    key.strip_prefix(ROOT)?.strip_prefix('/')?.split('/').next()?.parse().ok()
}

/// The node, the line and the motor in a key that [`of_motor`] made.
pub fn motor_of(key: &str) -> Option<(Name, &str, u8)> {
    let [line, motor, _] = key.strip_prefix(ROOT)?.split('/').skip(2).collect::<Vec<_>>()[..]
    else {
        return None;
    };
    Some((node_of(key)?, line, motor.parse().ok()?))
}

/// Who asks, in the key of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asker {
    /// What is asked for.
    pub scope: Scope,
    /// Who it is.
    pub who: Name,
    /// The session.
    pub session: Name,
}

impl Asker {
    /// Reads a key that [`ask`] made.
    pub fn of(key: &str) -> Option<Self> {
        let [ASK, _, scope, who, session] = behind_node(key)?[..] else { return None };
        let scope = Scope::ALL.into_iter().find(|it| it.word() == scope)?;
        Some(Asker { scope, who: who.parse().ok()?, session: session.parse().ok()? })
    }
}

const ASK: &str = "ask";

/// The node and its run, in a key that [`alive`], [`ended`] or [`info`] made.
pub fn run_of(key: &str) -> Option<(Name, Name)> {
    let [_, boot] = behind_node(key)?[..] else { return None };
    Some((node_of(key)?, boot.parse().ok()?))
}

/// Who is there, and in which session, in a key that [`session_token`] made.
pub fn parse_session_token(key: &str) -> Option<(Name, Name)> {
    let [_, _, who, session] = behind_node(key)?[..] else { return None };
    Some((who.parse().ok()?, session.parse().ok()?))
}

/// The parts of a key that is about a whole node, behind its name.
fn behind_node(key: &str) -> Option<Vec<&str>> {
    let mut parts = key.strip_prefix(ROOT)?.split('/').skip(2);
    (parts.next()? == WHOLE).then(|| parts.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        text.parse().unwrap()
    }

    #[test]
    fn who_asks_stands_in_the_key() {
        let (node, boot, who) = (name("arm1"), name("5d"), name("alice"));
        for scope in Scope::ALL {
            let key = ask(&node, &boot, scope, &who, &name("7f"));
            let asker = Asker { scope, who: who.clone(), session: name("7f") };
            assert_eq!(Asker::of(&key), Some(asker), "{key}");
        }
        let (alive, here) = (alive(&node, &boot), session_token(&node, &boot, &who, &name("7f")));
        assert_eq!(run_of(&alive), Some((node, boot)));
        assert_eq!(parse_session_token(&here), Some((who, name("7f"))));
    }

    #[test]
    fn nothing_more_stands_in_the_key_of_a_request() {
        for key in [
            "motorlink/v1/arm1/node/ask/5d/own/alice/7f",
            "motorlink/v1/arm1/node/ask/5d/see/mallory/act/alice/7f",
            "motorlink/v1/arm1/node/ask/5d/act/alice",
            "motorlink/v1/arm1/node/ask/5d/act/alice/*",
            "motorlink/v1/arm1/st0/ask/5d/act/alice/7f",
            "alice/7f",
        ] {
            assert_eq!(Asker::of(key), None, "{key}");
        }
    }

    #[test]
    fn a_query_names_one_motor_or_several() {
        let node = name("arm1");
        for it in MotorQuery::ALL {
            assert_eq!(
                one_motor(&of_motor(&node, "st0", 1, it.words())),
                Some(("st0", "1")),
                "{it:?}"
            );
            assert_eq!(one_motor(&of_all_motors(&node, it.words())), None, "{it:?}");
        }
        let of_all = of_motor(&node, "st0", 1, MotorQuery::Registers.words());
        let key = register(&node, "st0", 1, "SPEED_MEAS");
        assert_eq!((one_motor(&key), one_register(&key)), (Some(("st0", "1")), Some("SPEED_MEAS")));
        assert_eq!(one_register(&of_all), None);
        for key in [
            "motorlink/v1/*/st0/1/identity",
            "motorlink/v1/arm1/s$*/1/identity",
            "motorlink/v1/arm1/st0/**",
            "motorlink/v1/arm1/st0/1/**",
            "motorlink/v1/arm1/st0/1",
            "motorlink/**",
            "**",
        ] {
            assert_eq!(one_motor(key), None, "{key}");
        }
        assert_eq!(one_motor("motorlink/v1/arm1/st0/-1/settings"), Some(("st0", "-1")));
    }

    #[test]
    fn names_have_no_character_that_means_something_in_a_key() {
        for bad in [
            "",
            "..",
            ".",
            "-n",
            "--help",
            "a/b",
            "*",
            "a*",
            "$*",
            "a b",
            "a?",
            "a#",
            "@a",
            &"a".repeat(LONGEST + 1),
        ] {
            assert_eq!(bad.parse::<Name>(), Err(BadName), "{bad}");
            let near = Name::near(bad);
            assert_eq!(near.as_str().parse(), Ok(near.clone()), "{bad}");
        }
    }
}
