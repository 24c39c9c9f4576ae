//! The result of a measurement.

use std::error::Error;

/// A result, with any error.
pub type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;
