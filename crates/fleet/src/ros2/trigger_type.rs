//! The service type of ROS 2 that a node speaks. Its messages are those of recordings.

use motorlink_recording::schema::{Message, Time, with_dependencies};
use serde::{Deserialize, Serialize};

/// `std_srvs/srv/Trigger`. Its hash is over the request, the response and the event of both.
pub const TRIGGER: &str = "std_srvs/srv/Trigger";

const FIELDS: &str = "std_srvs/srv/Trigger_Request request_message\n\
    std_srvs/srv/Trigger_Response response_message\n\
    std_srvs/srv/Trigger_Event event_message\n";
const REQUEST: &str = "uint8 structure_needs_at_least_one_member\n";
const RESPONSE: &str = "bool success\nstring message\n";
const EVENT: &str = "service_msgs/ServiceEventInfo info\n\
    std_srvs/srv/Trigger_Request[<=1] request\n\
    std_srvs/srv/Trigger_Response[<=1] response\n";
const INFO: &str = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\n\
    int64 sequence_number\n";

/// The definition of [`TRIGGER`].
pub fn trigger() -> String {
    let used = [
        (TriggerResponse::TYPE, RESPONSE),
        ("std_srvs/srv/Trigger_Request", REQUEST),
        ("std_srvs/srv/Trigger_Event", EVENT),
        ("service_msgs/ServiceEventInfo", INFO),
        Time::DEPENDENCY,
    ];
    with_dependencies(FIELDS, &used)
}

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
        RESPONSE.to_owned()
    }
}
