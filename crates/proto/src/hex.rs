//! Bytes as text.

use core::fmt;

/// Displays bytes as hexadecimal text: `02 01 1e 21`.
///
/// ```
/// assert_eq!(motorlink_proto::Hex(&[2, 0x1e]).to_string(), "02 1e");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hex<'a>(
    /// The bytes.
    pub &'a [u8],
);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((first, others)) = self.0.split_first() else { return Ok(()) };
        write!(f, "{first:02x}")?;
        others.iter().try_for_each(|byte| write!(f, " {byte:02x}"))
    }
}
