//! Drives by their ports, and the commands for them.

use motorlink_proto::st::Flags;
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::RmdNode;
use motorlink_sim::st::StMotor;
use serde_json::{Value, json};

use super::Command;
use super::drives::Stage;
use super::signals::{Names, mode_number};

/// All drives of a bench.
#[derive(Default)]
pub(super) struct ServedDrives(Vec<ServedDrive>);

pub(super) struct ServedDrive {
    pub(super) port: String,
    pub(super) kind: Kind,
    pub(super) stage: Stage,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    St,
    Rmd,
}

impl ServedDrives {
    pub(super) fn add(&mut self, port: String, kind: Kind, stage: Stage) {
        self.0.push(ServedDrive { port, kind, stage });
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &ServedDrive> {
        self.0.iter()
    }

    /// Executes a command `now`. Returns the answer, or why the command was not executed.
    pub(super) fn execute(&self, now: Instant, command: &Command) -> Result<Value, String> {
        if let Command::State { port } = command {
            let wanted =
                |place: &&ServedDrive| port.as_ref().is_none_or(|port| *port == place.port);
            let states: Vec<Value> =
                self.iter().filter(wanted).map(|place| place.state(now)).collect();
            if states.is_empty() {
                return Err(self.which_port(port.as_deref()));
            }
            return Ok(json!({ "ok": true, "t": now.0 as f64 / 1e6, "state": states }));
        }
        command.check()?;
        let place = self.find(command.port())?;
        let drives = &mut place.stage.at(now).drives;
        match place.kind {
            Kind::St => drives.change_st(now, command)?,
            Kind::Rmd => drives.change_rmd(now, command)?,
        }
        Ok(json!({ "ok": true }))
    }

    fn find(&self, port: Option<&str>) -> Result<&ServedDrive, String> {
        let found = match (port, &self.0[..]) {
            (None, [only]) => Some(only),
            (None, _) => None,
            (Some(port), places) => places.iter().find(|place| place.port == port),
        };
        found.ok_or_else(|| self.which_port(port))
    }

    fn which_port(&self, asked: Option<&str>) -> String {
        let ports: Vec<&str> = self.iter().map(|place| place.port.as_str()).collect();
        let ports = ports.join(", ");
        match asked {
            Some(port) => format!("`{port}` is not served; served ports: {ports}"),
            None => format!("the command needs a `port`; served ports: {ports}"),
        }
    }
}

impl ServedDrive {
    fn state(&self, now: Instant) -> Value {
        let drives = &self.stage.at(now).drives;
        let st = drives.st.iter().filter(|_| self.kind == Kind::St);
        let st = st.flat_map(|station| station.drive().motors().iter().zip(1..));
        let rmd = drives.rmd.iter().filter(|_| self.kind == Kind::Rmd);
        let rmd = rmd.flat_map(|bus| bus.nodes());
        let motors = st.map(|(motor, number)| st_state(motor, number)).chain(rmd.map(rmd_state));
        json!({ "port": self.port, "motors": motors.collect::<Vec<_>>() })
    }
}

fn st_state(motor: &StMotor, number: u8) -> Value {
    let truth = motor.truth();
    let plant = &truth.plant;
    json!({
        "motor": number,
        "status": truth.status.to_string(),
        "faults": { "occurred": names(truth.flags.occurred()), "present": names(truth.flags.present()) },
        "speed_rpm": truth.speed_rpm,
        "speed_reference_rpm": truth.speed_reference_rpm,
        "angle_degrees": plant.angle_degrees,
        "iq_amps": plant.iq,
        "id_amps": plant.id,
        "iq_reference_amps": truth.iq_reference,
        "id_reference_amps": truth.id_reference,
        "phase_amps": plant.phase_currents,
        "torque_newton_metres": plant.torque,
        "bus_volts": plant.bus_voltage,
        "chopping": plant.chopping,
        "celsius": truth.temperature,
        "winding_celsius": plant.winding_temperature,
        "load_newton_metres": motor.plant().machine().load().brake,
        "locked": plant.locked,
    })
}

fn rmd_state(node: &RmdNode) -> Value {
    let motor = node.motor();
    let truth = motor.truth();
    let plant = &truth.plant;
    json!({
        "motor": node.id().number(),
        "mode": Names::Mode.name(mode_number(truth.mode)),
        "errors": node.drive().errors().names().collect::<Value>(),
        "speed_dps": truth.speed_dps,
        "speed_reference_dps": truth.speed_reference_dps,
        "angle_degrees": plant.angle_degrees,
        "output_degrees": plant.output_degrees,
        "iq_amps": plant.iq,
        "id_amps": plant.id,
        "phase_amps": plant.phase_currents,
        "torque_newton_metres": plant.torque,
        "supply_volts": plant.bus_voltage,
        "chopping": plant.chopping,
        "celsius": truth.temperature,
        "winding_celsius": plant.winding_temperature,
        "load_newton_metres": motor.plant().machine().load().brake,
        "locked": plant.locked,
        "rom_writes": motor.rom_writes(),
    })
}

fn names(faults: u16) -> Value {
    Flags::names(faults).collect()
}
