//! The steps of the demo. All values are read through the ports.

use std::time::{Duration, Instant};

use motorlink::arrival::ArrivalProgress;
use motorlink::rmd::{
    self, ArrivalOptions, CentiDegrees, CentiDps, IqCommand, MotorId, SetTorque4, SpeedLimit,
    Target,
};
use motorlink::st::{self, Flags, Ramp, Status, register};

use super::bench::Drives;
use super::screen::Screen;
use super::table::Row;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::print_line;

/// How often the table is read.
const TICK: Duration = Duration::from_millis(50);
/// Timeout of a step.
const PATIENCE: Duration = Duration::from_secs(60);

pub struct Story<'a> {
    drives: &'a Drives,
    st: &'a st::Client,
    bus: &'a rmd::Client,
    screen: &'a mut Screen,
    rows: Vec<Row>,
    began: Instant,
    exchanges: u64,
    exchanging: Duration,
    done: Vec<String>,
}

/// Summary at the end of the demo.
pub struct Summary {
    lines: Vec<String>,
}

impl<'a> Story<'a> {
    pub fn new(
        drives: &'a Drives,
        st: &'a st::Client,
        bus: &'a rmd::Client,
        screen: &'a mut Screen,
    ) -> Self {
        Story {
            drives,
            st,
            bus,
            screen,
            rows: Vec::new(),
            began: Instant::now(),
            exchanges: 0,
            exchanging: Duration::ZERO,
            done: Vec::new(),
        }
    }

    pub fn tell(&mut self) -> Result<(), Failure> {
        self.meet()?;
        self.spin()?;
        self.reverse()?;
        self.turn_rmd()?;
        self.position()?;
        self.break_and_mend()?;
        self.rest()
    }

    pub fn summary(&self) -> Summary {
        let rate = self.exchanges as f64 / self.exchanging.as_secs_f64().max(1e-9);
        let (st, rmd) = (self.st.counters(), self.bus.counters());
        let mut lines = vec![String::new(), "What you saw:".to_owned()];
        lines.extend(self.done.iter().map(|done| format!("  - {done}")));
        lines.push(format!(
            "{} exchanges in {:.0} s, {:.0} µs each; {} lost, {} late, {} damaged.",
            self.exchanges,
            self.began.elapsed().as_secs_f64(),
            1e6 / rate,
            st.losses,
            rmd.late,
            rmd.malformed
        ));
        lines.push(String::new());
        lines.push("See them in a browser: `make monitor`, or `motorlink monitor`.".to_owned());
        lines.push("Next: `motorlink sim &`, then `motorlink st -p ./st0 status`,".to_owned());
        lines.push(
            "`motorlink rmd -p slcan:./can0 scan`; `motorlink ports` for real drives.".to_owned(),
        );
        Summary { lines }
    }

    fn meet(&mut self) -> Result<(), Failure> {
        let info = self.st.board_info()?;
        let [major, minor, patch] = info.version;
        let mut ids = Vec::new();
        for id in 1..=4 {
            self.bus.motor(id)?.status()?;
            ids.push(id.to_string());
        }
        self.screen.say(&format!(
            "The ST drive is {} {major}.{minor}.{patch}; RMD motors {} answer.",
            info.name,
            ids.join(", ")
        ));
        self.watch(Duration::from_millis(300))
    }

    fn spin(&mut self) -> Result<(), Failure> {
        self.screen.say("ST motor 1: START_MOTOR, then a ramp to 1500 rpm in 800 ms.");
        let motor = self.st.motor(1)?;
        motor.set_ramp(Ramp { speed_rpm: 1500, duration_ms: 800 })?;
        motor.start()?;
        self.until("ST motor 1 reaches 1500 rpm", |_| near(&motor, 1500))?;
        self.screen.say("ST motor 2: the same, with its encoder aligned first.");
        let second = self.st.motor(2)?;
        second.set_ramp(Ramp { speed_rpm: 1000, duration_ms: 800 })?;
        second.start()?;
        self.until("ST motor 2 reaches 1000 rpm", |_| near(&second, 1000))?;
        self.done
            .push("two ST motors went through all states of a start and held their speed".into());
        Ok(())
    }

    fn reverse(&mut self) -> Result<(), Failure> {
        self.screen.say("ST motor 2 reverses: a ramp to -1000 rpm in 1 s.");
        let motor = self.st.motor(2)?;
        motor.set_ramp(Ramp { speed_rpm: -1000, duration_ms: 1000 })?;
        self.until("ST motor 2 reaches -1000 rpm", |_| near(&motor, -1000))?;
        self.done.push("one of them reversed its direction".into());
        Ok(())
    }

    fn turn_rmd(&mut self) -> Result<(), Failure> {
        self.screen.say("RMD motors 1 to 4: torque currents in one frame (0x280), then speeds.");
        let torques = [0.5, -0.5, 0.4, -0.4].map(IqCommand::from_amps);
        let all = (1..=4).filter_map(MotorId::new).collect();
        for reply in self.bus.set_torque4(SetTorque4(torques), all)?.into_iter().flatten() {
            reply?;
        }
        self.watch(Duration::from_millis(400))?;
        for (id, dps) in [(1, 360.0), (2, -360.0), (3, 720.0), (4, -720.0)] {
            self.bus.motor(id)?.set_speed(CentiDps::from_dps(dps))?;
        }
        let bus = self.bus;
        self.until("RMD motor 3 turns with 720 °/s", |_| {
            Ok((bus.motor(3)?.motion_status()?.speed.0 - 720).abs() <= 15)
        })?;
        self.done.push("four RMD motors held torque, then speed".into());
        Ok(())
    }

    fn position(&mut self) -> Result<(), Failure> {
        self.screen.say("RMD motor 1 turns to 810° at 500 °/s or less; the others switch off.");
        let motor = self.bus.motor(1)?;
        for id in 2..=4 {
            self.bus.motor(id)?.off()?;
        }
        motor.stop()?;
        let target = CentiDegrees::from_degrees(810.0);
        let (to, most) = (Target::MultiTurn(target), Some(SpeedLimit(500)));
        let options = ArrivalOptions { timeout: Some(PATIENCE), ..Default::default() };
        let mut moved = motor.prepare_move(to, most, options)?;
        motor.set_position(target, most)?;
        let reached = loop {
            match moved.advance()? {
                ArrivalProgress::Arrived(arrived) => break arrived.angle.angle.degrees(),
                ArrivalProgress::Wait(_) => self.tick()?,
            }
        };
        self.tick()?;
        self.done.push(format!("an RMD motor moved to {reached:.2}° and held its position"));
        Ok(())
    }

    fn break_and_mend(&mut self) -> Result<(), Failure> {
        self.screen.say("An over-current is simulated in ST motor 1. Its drive switches it off.");
        let motor = self.st.motor(1)?;
        self.drives.st_fault(1, "BREAK_IN")?;
        self.until("ST motor 1 is in fault", |_| {
            Ok(matches!(motor.status()?, Status::FaultNow | Status::FaultOver))
        })?;
        let faults = motor.flags()?;
        self.screen.say(&format!("ST motor 1 reports {}.", in_words(faults)));
        self.watch(Duration::from_millis(500))?;
        self.screen.say("The program waits for standstill, sends FAULT_ACK and restarts it.");
        self.tick()?;
        self.until("ST motor 1 stands still", |_| Ok(motor.get(register::SPEED_MEAS)?.abs() < 30))?;
        motor.fault_ack()?;
        self.until("ST motor 1 is idle", |_| Ok(motor.status()? == Status::Idle))?;
        motor.set_ramp(Ramp { speed_rpm: 1200, duration_ms: 500 })?;
        motor.start()?;
        self.until("ST motor 1 reaches 1200 rpm", |_| near(&motor, 1200))?;
        self.done.push(format!(
            "a fault ({faults}) was latched and acknowledged, and the motor ran again"
        ));
        Ok(())
    }

    fn rest(&mut self) -> Result<(), Failure> {
        self.screen.say("Everything stops.");
        let st = self.st;
        for number in 1..=2 {
            st.motor(number)?.stop()?;
        }
        self.bus.motor(1)?.off()?;
        self.until("the ST motors are idle", |_| {
            Ok(st.motor(1)?.status()? == Status::Idle && st.motor(2)?.status()? == Status::Idle)
        })
    }

    /// Shows the table until `reached` returns true.
    fn until(
        &mut self,
        what: &str,
        mut reached: impl FnMut(&mut Self) -> Result<bool, Failure>,
    ) -> Result<(), Failure> {
        let begun = Instant::now();
        while !reached(self)? {
            if begun.elapsed() > PATIENCE {
                return Err(Failure::refused(format!("timeout: {what} was expected")));
            }
            self.tick()?;
        }
        self.tick()
    }

    fn watch(&mut self, time: Duration) -> Result<(), Failure> {
        let begun = Instant::now();
        while begun.elapsed() < time {
            self.tick()?;
        }
        Ok(())
    }

    fn tick(&mut self) -> Result<(), Failure> {
        let begun = Instant::now();
        self.rows.clear();
        for number in 1..=2 {
            let row = st_row(&self.st.motor(number)?)?;
            self.rows.push(row);
            self.exchanges += 6;
        }
        for id in 1..=4 {
            let row = self.rmd_row(id)?;
            self.rows.push(row);
            self.exchanges += 2;
        }
        self.exchanging += begun.elapsed();
        self.screen.show(&self.rows);
        if interrupt::wait(TICK) { Ok(()) } else { Err(Failure::Interrupted) }
    }

    fn rmd_row(&self, id: u8) -> Result<Row, Failure> {
        let motor = self.bus.motor(id)?;
        let (state, motion) = (motor.status()?, motor.motion_status()?);
        let turning = motion.speed.0 != 0;
        let status = match (state.errors.is_empty(), turning, motion.iq.0 != 0) {
            (false, ..) => state.errors.to_string(),
            (true, true, _) => "turning".to_owned(),
            (true, false, true) => "holding".to_owned(),
            (true, false, false) => "at rest".to_owned(),
        };
        Ok(Row {
            motor: format!("RMD {id}"),
            state: status,
            speed: format!("{} °/s", motion.speed.0),
            current: format!("{:.2} A", motion.iq.amps()),
            temperature: format!("{} °C", state.temperature.0),
            voltage: format!("{:.1} V", state.voltage.volts()),
            is_turning: turning,
            is_fault: !state.errors.is_empty(),
        })
    }
}

fn st_row(motor: &st::Motor<'_>) -> Result<Row, Failure> {
    let (status, faults) = (motor.status()?, motor.flags()?);
    let names: Vec<&str> = Flags::names(faults.occurred()).collect();
    let state = format!("{status} {}", names.join(" "));
    Ok(Row {
        motor: format!("ST {}", motor.number().number()),
        state: state.trim_end().to_owned(),
        speed: format!("{} rpm", motor.get(register::SPEED_MEAS)?),
        current: format!("{} s16A", motor.get(register::TORQUE_MEAS)?),
        temperature: format!("{} °C", motor.get(register::HEATS_TEMP)?),
        voltage: format!("{} V", motor.get(register::BUS_VOLTAGE)?),
        is_turning: status == Status::Run,
        is_fault: faults.occurred() != 0,
    })
}

/// Faults by their names, with what they mean.
fn in_words(faults: Flags) -> String {
    let all = faults.occurred() | faults.present();
    let known = Flags::NAMES.iter().filter(|(bit, ..)| all & bit != 0);
    let words: Vec<String> =
        known.map(|(_, name, meaning)| format!("{name} in FLAGS: {meaning}")).collect();
    words.join(", ")
}

fn near(motor: &st::Motor<'_>, rpm: i32) -> Result<bool, Failure> {
    Ok((motor.get(register::SPEED_MEAS)? - rpm).abs() <= 30)
}

impl Summary {
    pub fn print(&self) -> Result<(), Failure> {
        self.lines.iter().try_for_each(|text| print_line(text))
    }
}
