//! Writes of registers. Each is read back.

use motorlink_proto::st::{
    NotASetting, Profile, Ramp, RegisterId, Request as StRequest, Unverified, VerifiedWrite,
    parse_value,
};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_values::{self, Place, PlaceKind};
use motorlink_telemetry::share::message::Reason;
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target};

use super::motion_control::{Control, MotionPermit, MotionSession, send};
use super::settings;
use crate::message::Value;

/// A write of a page.
pub(super) struct Write {
    pub(super) target: Target,
    pub(super) name: String,
    pub(super) value: f64,
    pub(super) to_rom: bool,
}

impl Write {
    /// Writes the value; gives what was read back.
    pub(super) async fn carry_out(
        self,
        control: &Control,
        view: &Program,
        drive: &impl MotionPermit,
    ) -> Result<Vec<Value>, Refusal> {
        let exchanges = Exchanges::new(view, &self.target);
        let place = Place::named(&self.target, &self.name)?;
        let register = match (place.kind, exchanges.of_st()) {
            (PlaceKind::Register(register), Some((_, profile))) => {
                register.not_a_setting(profile).map(|why| (register, profile, why))
            }
            (PlaceKind::Measured, _) => {
                return Err(Refusal::usage(format!(
                    "{} is measured and cannot be written",
                    self.name
                )));
            }
            _ => None,
        };
        let Some((register, profile, why)) = register else {
            let (name, to_rom) = (&self.name, self.to_rom);
            let names = settings::write(control, &exchanges, name, self.value, to_rom).await?;
            return drive_values::read(&exchanges, &names).await;
        };
        let bits = digits(register, self.value, profile)?;
        let bytes = bits.to_le_bytes();
        let bytes = &bytes[..usize::from(register.write_size(profile)).min(bytes.len())];
        let request = StRequest::SetRegister { register, value: bytes };
        let request = Request::st(self.target.name.motor, request);
        control.limited(&self.target, |limited| limited.check(&request))?;
        if why == NotASetting::OneMeasurement {
            let _lane = exchanges.lane().await;
            send(control, &exchanges, &request).await?;
            return written(&exchanges, (register, profile, bits)).await;
        }
        // A reference or a mode: it may move the motor.
        let stops = control.stops(&self.target);
        let _turn = control.turn(&self.target).await;
        control.end_run(&self.target).await;
        let permitted = MotionSession::new(drive, false, stops).await?;
        permitted.send(control, &request).await?;
        let exchanges = Exchanges::new(&permitted.program, &self.target);
        written(&exchanges, (register, profile, bits)).await
    }
}

/// Reads a register back that was written once: a library must not repeat a write that makes the motor
/// act.
async fn written(
    exchanges: &Exchanges<'_>,
    (register, profile, bits): (RegisterId, Profile, i32),
) -> Result<Vec<Value>, Refusal> {
    let values = match VerifiedWrite::new::<()>(profile, register, bits) {
        Err(Unverified::NotReadable) => {
            vec![Value::text(&register.to_string(), "written; it cannot be read back")]
        }
        write => {
            let read = exchanges.register(register).await?;
            // The drive changes references and modes itself.
            if let Ok(write) = write
                && write.expected() != read
            {
                let place = exchanges.place();
                let message = format!("{place}: the drive did not take the value of {register}");
                return Err(Refusal::new(Reason::Refused, message));
            }
            let reading = motorlink_proto::st::Reading { register, bits: read, profile };
            vec![Value::of_register(reading)]
        }
    };
    exchanges.carried_out().await.map(|()| values)
}

fn digits(register: RegisterId, value: f64, profile: Profile) -> Result<i32, Refusal> {
    let is_writable =
        register.shape().is_some_and(|shape| drive_values::is_writable(&shape, profile));
    if !is_writable {
        return Err(Refusal::unsent(format!("{register} cannot be written")));
    }
    let bits = parse_value(register, &value.to_string(), profile, false);
    let bits = bits.map_err(Refusal::unsent)?;
    let ramp = Ramp { speed_rpm: bits, duration_ms: 0 };
    if register == RegisterId::RAMP_FINAL_SPEED && !ramp.is_possible() {
        let most = Ramp::MAX_SPEED_RPM;
        return Err(Refusal::unsent(format!("{register}: {value} rpm is beyond ±{most} rpm")));
    }
    Ok(bits)
}
