//! The search for the motors of a line.

use motorlink_proto::rmd::{Command, MotorSet, ReadStatus};
use motorlink_proto::st::{ErrorCode, RegisterId, Request};
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::motor_exchange::{ATTEMPTS, Exchanges, Target, is_worth_repeating};
use tokio::task::JoinSet;

/// The motors that reply.
///
/// # Errors
/// The line fails. No motor replies.
pub(super) async fn motors(
    view: &Program,
    line: &str,
    speaks: DriveProtocol,
) -> Result<Vec<u8>, Refusal> {
    match speaks {
        DriveProtocol::St(_) => {
            let mut attempt = 1;
            loop {
                match st_motors(view, line, speaks).await {
                    Err(why) if is_worth_repeating(&why) && attempt < ATTEMPTS => attempt += 1,
                    found => return found,
                }
            }
        }
        DriveProtocol::Rmd => rmd_motors(view, line).await,
    }
}

async fn st_motors(view: &Program, line: &str, speaks: DriveProtocol) -> Result<Vec<u8>, Refusal> {
    let mut found = Vec::new();
    let targets: Vec<_> =
        (1..=u8::MAX).map_while(|number| Target::new(line, number, speaks).ok()).collect();
    let Some(first) = targets.first() else { return Ok(found) };
    let _lane = Exchanges::new(view, first).lane().await;
    for target in &targets {
        let motor = target.name.motor;
        let exchanges = Exchanges::new(view, target);
        match exchanges.st(motor, &Request::GetRegister(RegisterId::STATUS)).await {
            Ok(_) => found.push(motor),
            Err(Refusal { code: Some(code), .. }) => {
                if ErrorCode::from(code) != ErrorCode::BadMotorSelected {
                    found.push(motor);
                }
            }
            // The drive no longer replies: do not wait for the other numbers.
            Err(why) if found.is_empty() => return Err(why),
            Err(_) => break,
        }
    }
    Exchanges::new(view, first).confirm().await?;
    Ok(found)
}

async fn rmd_motors(view: &Program, line: &str) -> Result<Vec<u8>, Refusal> {
    let mut asked = JoinSet::new();
    for id in MotorSet::ALL {
        let (view, target) = (view.clone(), Target::new(line, id.number(), DriveProtocol::Rmd)?);
        asked.spawn(async move {
            let exchanges = Exchanges::new(&view, &target);
            // On a busy machine one reply may be late.
            let reply = match exchanges.rmd(ReadStatus.encode()).await {
                Err(_) => exchanges.rmd(ReadStatus.encode()).await,
                reply => reply,
            };
            reply.map(|_| target.name.motor)
        });
    }
    let (mut found, mut failure) = (Vec::new(), None);
    while let Some(one) = asked.join_next().await {
        match one {
            Ok(Ok(motor)) => found.push(motor),
            Ok(Err(why)) => failure = Some(why),
            Err(_) => {}
        }
    }
    found.sort_unstable();
    match failure {
        Some(why) if found.is_empty() => Err(why),
        _ => Ok(found),
    }
}
