//! A kind of message, as a kernel that can be counted.

use motorlink_kernels::kernel::Kernel;

/// A request and its reply, each as a kernel that encodes and decodes it.
pub(super) struct Kind {
    pub(super) name: String,
    pub(super) request: Kernel,
    pub(super) reply: Kernel,
}

impl Kind {
    pub(super) fn new(
        name: String,
        request: impl FnMut() + 'static,
        reply: impl FnMut() + 'static,
    ) -> Self {
        let request = Kernel::new(format!("{name} request"), request);
        let reply = Kernel::new(format!("{name} reply"), reply);
        Kind { name, request, reply }
    }
}
