//! The service type of ROS 2 that a node speaks. Its messages are those of recordings.

use motorlink_recording::schema::Message;
use serde::{Deserialize, Serialize};

/// How it went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it was done.
    pub success: bool,
    /// The text of it.
    pub message: String,
}

impl Message for TriggerResponse {
    const TYPE: &'static str = "std_srvs/srv/Trigger_Response";

    fn definition() -> String {
        "bool success\nstring message\n".to_owned()
    }
}
