//! What the document "Motor Control Protocol" demands.

use crate::clause::Clause;

/// Every sentence of the document that demands something, in its order.
pub static CLAUSES: &[Clause] =
    &[Clause::new("ST-4.7-02", "The slave acknowledges GET_BOARD_INFO with 32 bytes.")];
