use proptest::prelude::*;

use super::*;

fn port(name: &str) -> PortName {
    name.parse().unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn refusal(name: &str) -> String {
    match name.parse::<PortName>() {
        Ok(port) => panic!("{name} was taken for {port:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn every_form_has_one_spelling_without_what_is_the_default() {
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
        ("socketcan:vcan0", "socketcan:vcan0"),
        ("sim:", "sim:"),
        ("sim:bench.toml", "sim:bench.toml"),
    ] {
        assert_eq!(port(given).to_string(), spelled);
        assert_eq!(port(spelled), port(given));
    }
}

#[test]
fn a_name_that_is_wrong_says_how_it_is_right() {
    for (name, says) in [
        ("can0", "did you mean `socketcan:can0`?"),
        ("can:can0", "did you mean `socketcan:can0`?"),
        ("usb:/dev/ttyACM0", "did you mean `serial:/dev/ttyACM0`?"),
        ("192.168.1.5:4000", "did you mean `tcp:192.168.1.5:4000`?"),
        ("pty:./st0", "did you mean `serial:./st0`?"),
        ("sim", "did you mean `sim:`?"),
        ("st0", "did you mean `./st0`?"),
        ("", "ports are /dev/ttyACM0"),
        ("serial:", "lacks a device"),
        ("socketcan:", "lacks an interface"),
        ("tcp:host", "lacks a TCP port"),
        ("tcp::4000", "lacks a host"),
        ("tcp:host:70000", "lacks a TCP port from 0 to 65535"),
        ("tcp:::1:4000", "lacks the brackets"),
        ("tcp:host:0", "the port cannot be `0`"),
        ("/dev/ttyACM0?baud=fast", "baud cannot be `fast`"),
        ("/dev/ttyACM0?baud=0", "baud cannot be `0`"),
        ("/dev/ttyACM0?boud=9600", "unknown option `boud`; there is baud"),
        ("tcp:host:1?baud=9600", "unknown option `baud`"),
        ("tcp:host:1?clock=5003", "lacks a TCP port; write it like tcp:127.0.0.1:4000?clock="),
        ("tcp:host:1?clock=", "lacks a TCP port"),
        ("tcp:host:1?clock=host:0", "the port cannot be `0`"),
        ("/dev/ttyACM0?clock=host:1", "unknown option `clock`; there is baud"),
        ("slcan:/dev/ttyACM0?clock=host:1", "unknown option `clock`; there is bitrate, echo"),
        ("slcan:/dev/ttyACM0?bitrate=123", "bitrate cannot be `123`; use 10000, 20000"),
        ("slcan:/dev/ttyACM0?echo=yes", "echo cannot be `yes`"),
    ] {
        let message = refusal(name);
        assert!(message.contains(says), "{name:?} gave: {message}");
    }
    for (name, says) in [
        ("st0", "did you mean `pty:st0`?"),
        ("can0", "tcp-listen:ADDR:PORT and socketcan:INTERFACE"),
        ("socketcan:", "lacks an interface; write it like socketcan:can0"),
    ] {
        let message = name.parse::<ServeName>().expect_err("no served port").to_string();
        assert!(message.contains(says), "{name:?} gave: {message}");
    }
}

fn addresses() -> impl Strategy<Value = TcpAddress> {
    ("[a-z0-9.-]{1,12}|\\[::1\\]", 1..=u16::MAX).prop_map(|(host, port)| TcpAddress { host, port })
}

fn lines() -> impl Strategy<Value = LineName> {
    let path = prop_oneof!["/[a-zA-Z0-9_./?=&:-]{0,20}", "\\.[a-z/?]{0,9}"];
    prop_oneof![
        (path, 1..=4_000_000_u32)
            .prop_map(|(path, baud)| LineName::Serial { path: path.into(), baud }),
        (addresses(), proptest::option::of(addresses()))
            .prop_map(|(address, clock)| LineName::Tcp { address, clock }),
    ]
}

proptest! {
    #[test]
    fn a_printed_port_reads_back(line in lines(), index in 0..9_u8, echo: bool) {
        let bitrate = Bitrate::from_index(index).expect("S0 to S8");
        for name in [PortName::Line(line.clone()), PortName::Slcan { line, bitrate, echo }] {
            prop_assert_eq!(name.to_string().parse(), Ok(name));
        }
    }

    #[test]
    fn a_printed_serve_name_reads_back(path in "[./a-z0-9:]{1,20}", port: u16) {
        let listen = ServeName::TcpListen { host: "[::]".into(), port };
        let interface = ServeName::SocketCan(path.clone());
        let pty = ServeName::Pty(path.clone().into());
        for name in [pty, ServeName::SlcanPty(path.into()), listen, interface] {
            prop_assert_eq!(name.to_string().parse(), Ok(name));
        }
    }

    #[test]
    fn any_text_is_taken_or_refused(text in "\\PC{0,40}") {
        let _ = text.parse::<PortName>().map_err(|error| error.to_string());
        let _ = text.parse::<ServeName>().map_err(|error| error.to_string());
    }
}
