//! A request that owns its bytes, for queues and programs in other languages.

use std::vec::Vec;

use super::Request;

/// A [`Request`] that owns its bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnedRequest {
    /// Without its bytes.
    request: Request<'static>,
    bytes: Vec<u8>,
}

impl OwnedRequest {
    /// The request.
    pub fn request(&self) -> Request<'_> {
        match self.request {
            Request::SetRegister { register, .. } => {
                Request::SetRegister { register, value: &self.bytes }
            }
            Request::GetProfilerInfo(_) => Request::GetProfilerInfo(&self.bytes),
            Request::ConfigureSegment { segment, .. } => {
                Request::ConfigureSegment { segment, registers: &self.bytes }
            }
            other => other,
        }
    }
}

impl From<Request<'_>> for OwnedRequest {
    fn from(request: Request<'_>) -> Self {
        let owned = |request, bytes: &[u8]| OwnedRequest { request, bytes: bytes.to_vec() };
        match request {
            Request::SetRegister { register, value } => {
                owned(Request::SetRegister { register, value: &[] }, value)
            }
            Request::GetProfilerInfo(steps) => owned(Request::GetProfilerInfo(&[]), steps),
            Request::ConfigureSegment { segment, registers } => {
                owned(Request::ConfigureSegment { segment, registers: &[] }, registers)
            }
            Request::GetRegister(register) => owned(Request::GetRegister(register), &[]),
            Request::ExecuteCommand(command) => owned(Request::ExecuteCommand(command), &[]),
            Request::GetBoardInfo => owned(Request::GetBoardInfo, &[]),
            Request::SetRamp(ramp) => owned(Request::SetRamp(ramp), &[]),
            Request::GetRevupData(phase) => owned(Request::GetRevupData(phase), &[]),
            Request::SetRevupData(phase, data) => owned(Request::SetRevupData(phase, data), &[]),
            Request::SetCurrentReference(reference) => {
                owned(Request::SetCurrentReference(reference), &[])
            }
            Request::GetFirmwareVersion => owned(Request::GetFirmwareVersion, &[]),
            Request::GetSegment(segment) => owned(Request::GetSegment(segment), &[]),
            Request::SetTorqueRamp(ramp) => owned(Request::SetTorqueRamp(ramp), &[]),
            Request::SetPosition(target) => owned(Request::SetPosition(target), &[]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::st::RegisterId;

    #[test]
    fn a_request_is_the_same_when_it_owns_its_bytes() {
        let requests = [
            Request::SetRegister { register: RegisterId::SPEED_KP, value: &[1, 2] },
            Request::GetProfilerInfo(&[3]),
            Request::ConfigureSegment { segment: 1, registers: &[4, 5] },
            Request::GetRegister(RegisterId::STATUS),
            Request::GetBoardInfo,
        ];
        for request in requests {
            assert_eq!(OwnedRequest::from(request).request(), request);
        }
    }
}
