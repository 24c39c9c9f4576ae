//! Detects clients that are browsers: a web page can make one connect to a served TCP port.

/// Methods of HTTP, case-insensitive. The bytes of a client that starts with a part of one are
/// held.
const METHODS: [&str; 22] = [
    "GET",
    "HEAD",
    "POST",
    "PUT",
    "DELETE",
    "CONNECT",
    "OPTIONS",
    "TRACE",
    "PATCH",
    "PRI",
    "QUERY",
    "PROPFIND",
    "PROPPATCH",
    "MKCOL",
    "COPY",
    "MOVE",
    "LOCK",
    "UNLOCK",
    "REPORT",
    "SEARCH",
    "LINK",
    "PURGE",
];

/// A condition for a byte; `None` allows any byte.
type Byte = Option<fn(u8) -> bool>;
type Pattern = &'static [Byte];

/// A handshake record of version 3.0 to 3.4, of any length, with a ClientHello.
const TLS: Pattern = &[
    Some(|byte| byte == 0x16),
    Some(|byte| byte == 0x03),
    Some(|byte| byte <= 0x04),
    None,
    None,
    Some(|byte| byte == 0x01),
];
/// A Binding or Allocate request of any length with the magic cookie (RFC 8489). WebRTC sends it
/// over TCP.
const STUN: Pattern = &[
    Some(|byte| byte == 0x00),
    Some(|byte| byte == 0x01 || byte == 0x03),
    None,
    None,
    Some(|byte| byte == 0x21),
    Some(|byte| byte == 0x12),
    Some(|byte| byte == 0xA4),
    Some(|byte| byte == 0x42),
];
/// The length that ICE sends before it (RFC 4571).
const LENGTH: Pattern = &[Some(|byte| byte == 0x00), None];

/// A message of a drive's protocol never starts with this many letters and digits in a row.
const LONG_WORD: usize = 256;

/// Maximum number of held bytes.
pub(super) const HELD: usize = 16;

/// Holds the first bytes of a client until they cannot be the beginning of a browser's message.
#[derive(Debug)]
pub(super) enum Gate {
    Open,
    Held(Vec<u8>),
    /// For a detected browser. Drops everything.
    Closed,
}

impl Gate {
    /// Passes everything.
    pub(super) fn open() -> Self {
        Gate::Open
    }

    /// Checks the first bytes.
    pub(super) fn held() -> Self {
        Gate::Held(Vec::new())
    }

    /// Takes received bytes, which follow [`HELD`] bytes of free space. Returns the bytes that may
    /// pass now; `None` for a browser.
    pub(super) fn pass<'a>(&mut self, chunk: &'a mut [u8]) -> Option<&'a [u8]> {
        let held = match self {
            Gate::Open => return Some(&chunk[HELD..]),
            Gate::Closed => return None,
            Gate::Held(held) => held,
        };
        let start = HELD - held.len();
        chunk[start..HELD].copy_from_slice(held);
        let all = &chunk[start..];
        let (gate, passed) = match judge(all) {
            Judgement::Browser => (Gate::Closed, None),
            Judgement::Undecided => (Gate::Held(all.to_vec()), Some(&[][..])),
            Judgement::Welcome => (Gate::Open, Some(all)),
        };
        *self = gate;
        passed
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Judgement {
    Browser,
    Undecided,
    Welcome,
}

fn judge(bytes: &[u8]) -> Judgement {
    let mut judgement = judge_method(bytes);
    for [before, pattern] in [[&[], TLS], [&[], STUN], [LENGTH, STUN]] {
        let fits = |(&byte, place): (&u8, &Byte)| place.is_none_or(|is| is(byte));
        match bytes.iter().zip(before.iter().chain(pattern)).all(fits) {
            true if bytes.len() >= before.len() + pattern.len() => return Judgement::Browser,
            true if judgement == Judgement::Welcome => judgement = Judgement::Undecided,
            _ => {}
        }
    }
    judgement
}

/// A browser sends its request in one piece, so an unknown method must be complete in it.
fn judge_method(bytes: &[u8]) -> Judgement {
    let is_token = |byte: &&u8| byte.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(byte);
    let (word, rest) = bytes.split_at(bytes.iter().take_while(is_token).count());
    let begins = |method: &&str| {
        let length = word.len().min(method.len());
        word.len() <= method.len() && word.eq_ignore_ascii_case(&method.as_bytes()[..length])
    };
    let mut methods = METHODS.iter().filter(|method| begins(method));
    match rest {
        [] if methods.next().is_some() => Judgement::Undecided,
        [] if word.len() >= LONG_WORD => Judgement::Browser,
        [b' ', ..] if methods.any(|method| method.len() == word.len()) => Judgement::Browser,
        // The space may be the length of an ST frame, which no target follows.
        [b' ', target, ..] if !word.is_empty() && target.is_ascii_graphic() => Judgement::Browser,
        _ => Judgement::Welcome,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HELLO: &[u8] = &[0x16, 0x03, 0x01, 0x02, 0x00, 0x01, 0x00, 0x01, 0xFC, 0x03, 0x03];
    const BINDING: &[u8] = &[0, 1, 0, 8, 0x21, 0x12, 0xA4, 0x42, 1, 2, 3, 4, 5, 6, 7, 8];

    /// The bytes that a gate passes, for pieces that come one after the other; `None` if a browser
    /// was detected.
    fn passed<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> Option<Vec<u8>> {
        let mut gate = Gate::held();
        let mut passed = Vec::new();
        for piece in pieces {
            let mut chunk = [&[0; HELD], piece].concat();
            passed.extend_from_slice(gate.pass(&mut chunk)?);
        }
        Some(passed)
    }

    fn in_two(sent: &[u8], at: usize) -> Option<Vec<u8>> {
        let (first, second) = sent.split_at(at);
        passed([first, second].into_iter().filter(|piece| !piece.is_empty()))
    }

    #[test]
    fn no_byte_of_a_browser_passes_at_any_cut() {
        let framed = [&[0, 16], BINDING].concat();
        let rest = &b"/ HTTP/1.1\r\n\r\n\x23\x01\x01\x25"[..];
        let request = |method: &str| [method.as_bytes(), b" ", rest].concat();
        let requests: Vec<Vec<u8>> =
            METHODS.iter().chain(&["patch", "Get"]).map(|method| request(method)).collect();
        // A page can choose unknown methods. They come in one piece.
        for method in ["FOO", "M-SEARCH", "a", "#", "ALONGERMETHODTHANANYBODYHASEVERUSEDYET"] {
            assert_eq!(passed([&*request(method)]), None, "{method}");
        }
        let long = request(&"X".repeat(9_000));
        for piece in [300, 1_448, 4_080] {
            assert_eq!(passed(long.chunks(piece)), None, "in pieces of {piece} bytes");
        }
        for sent in requests.iter().map(Vec::as_slice).chain([HELLO, BINDING, &framed]) {
            assert_eq!(passed(sent.chunks(1)), None, "{sent:02x?} byte by byte");
            for at in 0..=sent.len() {
                assert_eq!(in_two(sent, at), None, "{sent:02x?} cut at {at}");
                // Before the browser is detected, no bytes have passed either.
                let first = passed([&sent[..at]]).unwrap_or_default();
                assert!(first.is_empty(), "{sent:02x?} cut at {at}");
            }
        }
    }

    #[test]
    fn no_byte_passes_after_a_browsers_first_piece() {
        let mut gate = Gate::held();
        for piece in
            [&b"POST / HTTP/1.1\r\n\r\n"[..], b"\x23\x01\x01\x25", b"t1418A2000000A08C0000\r"]
        {
            let mut chunk = [&[0; HELD], piece].concat();
            assert_eq!(gate.pass(&mut chunk), None, "{piece:02x?}");
        }
    }

    #[test]
    fn requests_to_drives_pass_completely_at_any_cut() {
        let frames =
            (0..=255u8).map(|header| vec![header, 0x02, 0x01, 0x01, header.wrapping_add(4)]);
        let lines = ["\rC\rS8\rO\r", "C\r", "O\r", "T00000141801020304050607081234\r", "t14180\r"];
        let lines = lines.map(|line| line.as_bytes().to_vec());
        // CONFIG_DYN_STRUCT of motor 1 with 31 registers: `.`, a space, segment 0.
        let segment = [&[0x2E, 0x20, 0x00][..], &[0x1E; 31], &[0x00]].concat();
        for sent in frames.chain(lines).chain([segment]) {
            for at in 0..=sent.len() {
                // Frame code 0 for motor 0 does not exist in the protocol, so it may be held.
                let whole = in_two(&sent, at).as_deref() == Some(&sent[..]);
                assert!(whole || sent[0] == 0, "{sent:02x?} at {at}");
            }
        }
    }

    #[test]
    fn held_bytes_pass_in_order_with_later_ones() {
        assert_eq!(passed([&b"P"[..], b"O", b"S"]), Some(Vec::new()));
        assert_eq!(passed([&b"PO"[..], b"S", b"\rGET / HTTP"]), Some(b"POS\rGET / HTTP".to_vec()));
    }
}
