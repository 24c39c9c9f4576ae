//! What the document "Motor control protocol (CAN bus) V1.62" demands.

use crate::clause::Clause;

/// Every sentence of the document that demands something, in its order.
pub static CLAUSES: &[Clause] =
    &[Clause::new("RMD-9A-01", "The drive answers 0x9A with one frame, DATA[0] the same.")];
