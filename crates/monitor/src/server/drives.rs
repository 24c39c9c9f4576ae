//! Requests about drives.

use std::future::Future;

use motorlink_telemetry::share::message::{Line, Reason};

use crate::message::{Answer, Ask};
use crate::program::{Program, Refusal};

/// How a page's motion is permitted.
pub trait Motion: Send + Sync {
    /// The session that turns motors. Refuses if the page may not turn any now.
    fn program(&self, hold: bool) -> impl Future<Output = Result<Program, Refusal>> + Send;
}

/// Carries out the requests of pages about drives.
pub struct Drives;

impl Drives {
    /// Drives on these lines.
    pub fn new(_: Vec<Line>) -> Self {
        Drives
    }

    /// Carries a request out.
    ///
    /// # Errors
    /// It is refused.
    pub async fn answer(&self, _: Ask, _: &Program, _: &impl Motion) -> Result<Answer, Refusal> {
        let message = "this request is not possible yet".to_owned();
        Err(Refusal { reason: Reason::Usage, message, code: None })
    }
}
