use motorlink_slcan::Bitrate;
use proptest::prelude::*;

use super::super::scheme::{Form, Port};
use super::*;

fn port(name: &str) -> PortName {
    name.parse().unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn refusal(name: &str) -> String {
    match name.parse::<PortName>() {
        Ok(port) => panic!("{name} was parsed as {port:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn every_form_has_one_spelling_without_defaults() {
    for (given, spelled) in [
        ("/dev/ttyACM0", "serial:/dev/ttyACM0"),
        ("ttyUSB1?baud=9600", "serial:/dev/ttyUSB1?baud=9600"),
        ("./st0?baud=115200", "serial:./st0"),
        ("serial:st0", "serial:st0"),
        ("tcp:drive.local:4000", "tcp:drive.local:4000"),
        ("tcp:[::1]:4000", "tcp:[::1]:4000"),
        ("tcp:h:1?clock=h:3", "tcp:h:1?clock=h:3"),
        ("tcp:odd?host:1?clock=[::1]:3", "tcp:odd?host:1?clock=[::1]:3"),
        ("slcan:tcp:h:1?clock=h:3&bitrate=250000", "slcan:tcp:h:1?bitrate=250000&clock=h:3"),
        ("slcan:./can0?bitrate=1000000&baud=115200", "slcan:./can0"),
        ("slcan:can0?baud=2000000", "slcan:can0?baud=2000000"),
        ("slcan:serial:/dev/ttyACM0?bitrate=500000", "slcan:/dev/ttyACM0?bitrate=500000"),
        ("slcan:tcp:h:1?bitrate=250000&echo=1", "slcan:tcp:h:1?bitrate=250000&echo=1"),
        ("serial:/dev/odd??", "serial:/dev/odd??"),
        ("./odd?name?baud=115200", "serial:./odd?name?"),
        ("tcp:odd?host:1?", "tcp:odd?host:1?"),
        ("slcan:./odd?name?echo=0", "slcan:./odd?name?"),
        ("slcan:serial:serial:x", "slcan:serial:serial:x"),
        ("slcan:serial:tcp:h:1", "slcan:serial:tcp:h:1"),
        ("unix:./drive", "unix:./drive"),
        ("slcan:unix:./drive?echo=1", "slcan:unix:./drive?echo=1"),
        ("socketcan:vcan0", "socketcan:vcan0"),
    ] {
        assert_eq!(port(given).to_string(), spelled);
        assert_eq!(port(spelled), port(given));
    }
}

#[test]
fn names_of_one_device_have_one_place() {
    for (one, other) in [
        ("tcp:localhost:4000", "tcp:127.0.0.1:4000"),
        ("tcp:LocalHost:4000", "tcp:[::1]:4000"),
        ("tcp:Drive.local:4000", "tcp:drive.local:4000"),
        ("tcp:[2001:DB8:0::1]:4000", "slcan:tcp:[2001:db8::1]:4000"),
        ("slcan:tcp:h:1?bitrate=250000", "tcp:h:1"),
        ("ttyUSB1?baud=9600", "/dev/ttyUSB1"),
        ("tcp:127.1:4000", "tcp:0x7f.0.0.1:4000"),
        ("tcp:[::ffff:127.0.0.1]:4000", "tcp:0.0.0.0:4000"),
        ("./drive", "./src/../drive"),
    ] {
        assert!(port(one).place().is(&port(other).place()), "{one} {other}");
    }
    for (one, other) in [
        ("tcp:127.0.0.1:4000", "tcp:127.0.0.1:4001"),
        ("tcp:127.0.0.1:4000", "tcp:127.0.0.2:4000"),
        ("tcp:h:1", "unix:h:1"),
    ] {
        assert!(!port(one).place().is(&port(other).place()), "{one} {other}");
    }
}

#[test]
fn a_wrong_name_is_refused_with_a_valid_form() {
    for (name, says) in [
        ("can0", "did you mean `socketcan:can0`?"),
        ("can:can0", "did you mean `socketcan:can0`?"),
        ("usb:/dev/ttyACM0", "did you mean `serial:/dev/ttyACM0`?"),
        ("192.168.1.5:4000", "did you mean `tcp:192.168.1.5:4000`?"),
        ("pty:./st0", "did you mean `serial:./st0`?"),
        ("st0", "did you mean `./st0`?"),
        ("COM3", "`COM3` is a port of Windows"),
        ("com12:", "`com12:` is a port of Windows"),
        ("PCAN_USBBUS1", "`PCAN_USBBUS1` is a port of Windows"),
        ("COMPORT", "did you mean `./COMPORT`?"),
        ("", "`` is not the name of a port; ports are /dev/ttyACM0"),
        ("foo:", "`foo:` is not the name of a port; ports are /dev/ttyACM0"),
        ("serial:", "lacks a device"),
        ("unix:", "lacks a path"),
        ("unix:./drive?baud=9600", "unknown option `baud`; valid options: none"),
        ("socketcan:", "lacks an interface"),
        ("tcp:host", "lacks a TCP port"),
        ("tcp::4000", "lacks a host"),
        ("tcp:host:70000", "lacks a TCP port from 0 to 65535"),
        ("tcp:::1:4000", "lacks the brackets"),
        ("tcp:host:0", "the port cannot be `0`"),
        ("/dev/ttyACM0?baud=fast", "baud cannot be `fast`"),
        ("/dev/ttyACM0?baud=0", "baud cannot be `0`"),
        ("/dev/ttyACM0?boud=9600", "unknown option `boud`; valid options: baud"),
        ("tcp:host:1?baud=9600", "unknown option `baud`"),
        ("/dev/ttyACM0?baud=9600&baud=19200", "has the option `baud` twice"),
        ("slcan:/dev/ttyACM0?echo=1&bitrate=500000&echo=1", "has the option `echo` twice"),
        ("tcp:host:1?clock=5003", "lacks a TCP port; write it like tcp:127.0.0.1:4000?clock="),
        ("tcp:host:1?clock=", "lacks a TCP port"),
        ("tcp:host:1?clock=host:0", "the port cannot be `0`"),
        ("/dev/ttyACM0?clock=host:1", "unknown option `clock`; valid options: baud"),
        ("slcan:/dev/ttyACM0?clock=host:1", "unknown option `clock`; valid options: bitrate, echo"),
        ("slcan:/dev/ttyACM0?bitrate=123", "bitrate cannot be `123`; use 10000, 20000"),
        ("slcan:/dev/ttyACM0?echo=yes", "echo cannot be `yes`"),
    ] {
        let message = refusal(name);
        assert!(message.contains(says), "{name:?} gave: {message}");
    }
}

fn addresses() -> impl Strategy<Value = String> {
    ("[a-z0-9.-]{1,12}|\\[::1\\]", 1..=u16::MAX).prop_map(|(host, port)| format!("{host}:{port}"))
}

/// A line's name and one of its options.
fn lines() -> impl Strategy<Value = (String, String)> {
    let path = prop_oneof!["/[a-zA-Z0-9_./?=&:-]{0,20}", "\\.[a-z/?]{0,9}"];
    let device = (path, 1..=4_000_000_u32);
    prop_oneof![
        device.prop_map(|(path, baud)| (format!("serial:{path}"), format!("baud={baud}"))),
        (addresses(), addresses())
            .prop_map(|(address, clock)| (format!("tcp:{address}"), format!("clock={clock}"))),
    ]
}

/// The name without its options, and these.
fn parts(port: &PortName) -> (String, Vec<String>) {
    (port.body(), port.options())
}

proptest! {
    #[test]
    fn a_printed_port_reads_back((line, option) in lines(), index in 0..9_u8, echo: bool) {
        let rate = Bitrate::from_index(index).expect("S0 to S8").bits_per_second();
        let adapter = format!("slcan:{line}?{option}&bitrate={rate}&echo={}", u8::from(echo));
        for name in [format!("{line}?{option}"), adapter] {
            let first = port(&name);
            prop_assert_eq!(parts(&port(&first.to_string())), parts(&first));
            prop_assert_eq!(first.options().iter().all(|option| name.contains(option)), true);
        }
        prop_assert_eq!(port(&format!("{line}?{option}")).body(), line);
    }

    #[test]
    fn any_text_is_parsed_or_refused(text in "\\PC{0,40}") {
        let _ = text.parse::<PortName>().map_err(|error| error.to_string());
    }
}

/// A scheme of another crate.
struct Elsewhere;

#[derive(Debug)]
struct Nowhere(String);

impl Port for Nowhere {
    fn body(&self) -> String {
        format!("elsewhere:{}", self.0)
    }
}

impl Scheme for Elsewhere {
    fn name(&self) -> &'static str {
        "elsewhere"
    }

    fn forms(&self) -> &'static [Form] {
        &[Form { text: "elsewhere:NAME", help: "a port of a test", carries: Carries::Bytes }]
    }

    fn parse(&self, rest: &str, _: &mut Given<'_>) -> Result<PortName, NameError> {
        Ok(PortName::new(Nowhere(rest.to_owned())))
    }
}

#[test]
fn a_scheme_of_another_crate_works_like_a_built_in_one() {
    let unregistered = refusal("elsewhere:x");
    assert!(unregistered.contains("registered no schemes of other crates"), "{unregistered}");

    register(&Elsewhere);
    register(&Elsewhere);
    assert_eq!(schemes().iter().filter(|scheme| scheme.name() == "elsewhere").count(), 1);
    assert_eq!(port("elsewhere:x").to_string(), "elsewhere:x");
    assert!(refusal("elsewhere:x?fast=1").ends_with("unknown option `fast`; valid options: none"));
    assert!(refusal("elsewhere").contains("did you mean `elsewhere:`?"));
    assert!(refusal("slcan:elsewhere:x").contains("no serial line at `elsewhere:x`"));
    assert!(refusal("nowhere").contains("and elsewhere:NAME"));
    let error = port("elsewhere:x").open_can().err().expect("it is not a CAN bus").to_string();
    assert!(error.starts_with("`elsewhere:x` cannot be used as a CAN bus: use slcan:"), "{error}");
}
