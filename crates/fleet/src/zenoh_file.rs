//! Zenoh configurations as files.

use std::fmt;
use std::fs;
use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};

use crate::certificate_info::Certificate;

/// What all configurations of Motorlink say: paths, and values in JSON.
const USUAL: [(&str, &str); 7] = [
    // Only the given addresses are used.
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/enabled", "false"),
    // What a slow program does not take is dropped, so that it delays no other program.
    (
        "qos/network",
        r#"[{"messages": ["put", "delete", "query"], "overwrite": {"congestion_control": "drop"}}]"#,
    ),
    // A busy computer sends late, so more may wait than usual before something is dropped: a lost question
    // costs a second.
    (
        "transport/link/tx/queue/size",
        r#"{"real_time": 16, "interactive_high": 16, "data_high": 16, "data": 16}"#,
    ),
    // A network that was cut is there again soon. What must happen in time does not depend on it.
    ("transport/link/tx/lease", "3000"),
    ("transport/link/tx/keep_alive", "4"),
    (
        "connect/retry",
        r#"{"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2}"#,
    ),
];

/// A configuration.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ConfigFile(Value);

impl ConfigFile {
    /// One with the usual values. `side` is `listen` or `connect`.
    pub(crate) fn new(mode: &str, side: &str, addresses: &[String]) -> Self {
        let mut file = ConfigFile(json!({"mode": mode}));
        file.set(&format!("{side}/endpoints"), json!(addresses));
        for (path, value) in USUAL {
            file.set(path, serde_json::from_str(value).unwrap_or_default());
        }
        file
    }

    /// Reads a file.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let failed = |why: String| format!("{}: {}", path.display(), why.trim());
        let text = fs::read_to_string(path).map_err(|error| failed(error.to_string()))?;
        json5::from_str(&text).map(ConfigFile).map_err(|error| failed(error.to_string()))
    }

    /// Sets the value at a path such as `listen/endpoints`.
    pub(crate) fn set(&mut self, path: &str, value: Value) {
        let mut place = &mut self.0;
        for part in path.split('/') {
            place = &mut place[part];
        }
        *place = value;
    }

    fn at(&self, path: &str) -> &Value {
        self.0.pointer(&format!("/{path}")).unwrap_or(&Value::Null)
    }

    /// A text.
    pub(crate) fn text(&self, path: &str) -> Option<String> {
        self.at(path).as_str().map(str::to_owned)
    }

    /// The texts of a list.
    pub(crate) fn texts(&self, path: &str) -> Vec<String> {
        let list = self.at(path).as_array().map(Vec::as_slice).unwrap_or_default();
        list.iter().filter_map(|it| it.as_str().map(str::to_owned)).collect()
    }

    /// Whether it listens nowhere, and connects to a router.
    pub(crate) fn is_of_client(&self) -> bool {
        self.at("mode") == "client"
    }

    /// Where it is reached, or what it connects to.
    pub(crate) fn addresses(&self) -> Vec<String> {
        self.texts(if self.is_of_client() { "connect/endpoints" } else { "listen/endpoints" })
    }

    /// The certificate that it shows.
    pub(crate) fn certificate(&self) -> Option<Certificate> {
        let tls = |member: &str| self.at("transport/link/tls").get(member)?.as_str();
        let of_side = |side: &str| match tls(&format!("{side}_certificate_base64")) {
            Some(text) => BASE64_STANDARD.decode(text).ok(),
            None => fs::read(tls(&format!("{side}_certificate"))?).ok(),
        };
        let pem = of_side("connect").or_else(|| of_side("listen"))?;
        Certificate::read(&pem)
    }
}

impl fmt::Display for ConfigFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#}", self.0)
    }
}
