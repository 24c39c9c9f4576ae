//! `sim:` is a port once its scheme is registered, and nothing before.

use std::time::Duration;

use motorlink_link::port::PortName;
use motorlink_testbench::register;

#[test]
fn simulated_drives_are_a_port_after_they_are_registered() {
    let refusal = "sim:".parse::<PortName>().expect_err("the scheme is not registered").to_string();
    assert!(refusal.contains("`sim:` of motorlink-testbench"), "{refusal}");

    register();
    for (given, spelled) in [("sim:", "sim:"), ("sim:bench.toml", "sim:bench.toml")] {
        let port: PortName = given.parse().expect("it is registered");
        assert_eq!(port.to_string(), spelled);
        assert!(port.is_in_process() && port.as_line().is_some() && port.as_can().is_some());
        assert_eq!(port.baud(), None);
    }
    let meant = "sim".parse::<PortName>().expect_err("it has no colon").to_string();
    assert!(meant.contains("did you mean `sim:`?") && meant.contains("sim:FILE.toml"), "{meant}");

    let mut line = "sim:".parse::<PortName>().unwrap().open_bytes().expect("an ST drive");
    line.write(&[0x02, 0x01, 0x1E, 0x21]).expect("GET_REG of SPEED_MEAS");
    let mut reply = [0; 16];
    let size = line.read(&mut reply, Some(Duration::from_secs(1))).expect("an answer");
    assert_eq!(reply[..size], [0xF0, 4, 0, 0, 0, 0, 0xF4]);
    "sim:".parse::<PortName>().unwrap().open_event_can().expect("a bus of RMD motors");

    let error = "sim:./never.toml".parse::<PortName>().unwrap().open_bytes();
    let error = error.err().expect("there is no such file").to_string();
    assert!(error.contains("cannot read `./never.toml`"), "{error}");
}
