//! The messages of ROS 2 that a node speaks. Each is written once: its bytes and its hash come from here.

use super::cdr::{Byte, Reader, Value, Writer};
use super::describe::{Field, Message, Type};

/// `"name in ROS" Name { field: type, .. }`
macro_rules! messages {
    ($( $(#[$doc:meta])* $ros:literal $name:ident { $( $(#[$meta:meta])* $field:ident: $kind:ty, )* } )+) => { $(
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $name {
            $( $(#[$meta])* pub $field: $kind, )*
        }

        impl $name {
            /// Its type.
            pub const MESSAGE: &'static Message = &Message {
                name: $ros,
                fields: &[$( Field { name: stringify!($field), kind: <$kind as Value>::TYPE }, )*],
            };
        }

        impl Value for $name {
            const TYPE: Type = Type::nested(Self::MESSAGE);

            fn write(&self, to: &mut Writer) {
                $( self.$field.write(to); )*
            }

            fn read(from: &mut Reader<'_>) -> Option<Self> {
                Some($name { $( $field: Value::read(from)?, )* })
            }
        }
    )+ };
}

messages! {
    /// A moment.
    "builtin_interfaces/msg/Time" Time {
        /// Seconds since 1970.
        sec: i32,
        /// Nanoseconds of the second.
        nanosec: u32,
    }

    /// When values were read.
    "std_msgs/msg/Header" Header {
        /// The moment.
        stamp: Time,
        /// Unused: joints have no frame.
        frame_id: String,
    }

    /// The state of joints, or what it shall be. An array is empty, or has a value for each name.
    "sensor_msgs/msg/JointState" JointState {
        /// When.
        header: Header,
        /// The joints.
        name: Vec<String>,
        /// rad
        position: Vec<f64>,
        /// rad/s
        velocity: Vec<f64>,
        /// N·m
        effort: Vec<f64>,
    }

    /// A detail.
    "diagnostic_msgs/msg/KeyValue" KeyValue {
        /// What it is.
        key: String,
        /// The value as text.
        value: String,
    }

    /// The state of a part.
    "diagnostic_msgs/msg/DiagnosticStatus" DiagnosticStatus {
        /// How bad it is.
        level: Byte,
        /// The part.
        name: String,
        /// The text of the state.
        message: String,
        /// The hardware.
        hardware_id: String,
        /// Details.
        values: Vec<KeyValue>,
    }

    /// The states of parts.
    "diagnostic_msgs/msg/DiagnosticArray" DiagnosticArray {
        /// When.
        header: Header,
        /// The parts.
        status: Vec<DiagnosticStatus>,
    }

    /// A request without content.
    "std_srvs/srv/Trigger_Request" TriggerRequest {
        /// A message has a field at least.
        structure_needs_at_least_one_member: u8,
    }

    /// How it went.
    "std_srvs/srv/Trigger_Response" TriggerResponse {
        /// Whether it was done.
        success: bool,
        /// The text of it.
        message: String,
    }
}

impl Time {
    /// A moment in seconds since 1970.
    pub fn of(seconds: f64) -> Self {
        let whole = seconds.floor();
        // Rounding must not give a whole second.
        let nanosec = ((seconds - whole) * 1e9).min(999_999_999.0) as u32;
        Time { sec: whole as i32, nanosec }
    }
}

/// The service type. Its hash is over the request, the response and the event of both.
pub const TRIGGER: Message = Message {
    name: "std_srvs/srv/Trigger",
    fields: &[
        Field { name: "request_message", kind: TriggerRequest::TYPE },
        Field { name: "response_message", kind: TriggerResponse::TYPE },
        Field { name: "event_message", kind: Type::nested(&TRIGGER_EVENT) },
    ],
};

const TRIGGER_EVENT: Message = Message {
    name: "std_srvs/srv/Trigger_Event",
    fields: &[
        Field { name: "info", kind: Type::nested(&EVENT_INFO) },
        Field { name: "request", kind: TriggerRequest::TYPE.at_most(1) },
        Field { name: "response", kind: TriggerResponse::TYPE.at_most(1) },
    ],
};

const EVENT_INFO: Message = Message {
    name: "service_msgs/msg/ServiceEventInfo",
    fields: &[
        Field { name: "event_type", kind: u8::TYPE },
        Field { name: "stamp", kind: Time::TYPE },
        Field { name: "client_gid", kind: u8::TYPE.array(16) },
        // int64
        Field { name: "sequence_number", kind: Type::plain(8) },
    ],
};
