//! RMD messages.

use std::hint::black_box;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;

use super::kind::Kind;

/// The identifier of motor 1.
const FIRST: u16 = MOTOR_BASE + 1;
/// The values of every message. Each uses as many bytes as it has.
const VALUES: [u8; 8] = [0, 1, 2, 3, 4, 5, 6, 7];

/// Every command of the table with its reply, and the torque frame.
pub(super) fn kinds() -> Vec<Kind> {
    let torque4 = Kind::new(
        format!("{TORQUE4_ID:#05x} SetTorque4"),
        there_and_back(TORQUE4_ID, SetTorque4::encode),
        reply::<SetTorque>(),
    );
    let mut kinds = commands();
    kinds.push(torque4);
    kinds
}

/// The types behind [`COMMANDS`], in its order.
fn commands() -> Vec<Kind> {
    macro_rules! of {
        ($($command:ident)+) => { vec![$( kind::<$command>(), )+] };
    }
    motorlink_proto::for_each_rmd_command!(of)
}

fn kind<C: Command + 'static>() -> Kind {
    Kind::new(name(C::CODE), there_and_back(FIRST, C::encode), reply::<C>())
}

fn name(code: Code) -> String {
    format!("{:#04x} {code:?}", u8::from(code))
}

fn reply<C: Command>() -> impl FnMut()
where
    C::Reply: 'static,
{
    there_and_back(FIRST, |reply: &C::Reply| reply.encode_as(C::CODE))
}

/// Encodes values into a frame with the identifier `id`, and decodes the frame.
fn there_and_back<P: Payload + 'static>(id: u16, encode: impl Fn(&P) -> [u8; 8]) -> impl FnMut() {
    let values = P::decode(&VALUES);
    move || {
        let frame = CanFrame::new(id, encode(black_box(&values)));
        if let Some((_, data)) = black_box(&frame).eight_bytes() {
            black_box(P::decode(data));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_of_the_table_is_measured() {
        let measured = commands().into_iter().map(|kind| kind.name);
        assert!(measured.eq(COMMANDS.iter().map(|row| name(row.code))));
    }
}
