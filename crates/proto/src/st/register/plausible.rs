//! Values that show a wrong profile.

use super::id::RegisterId;
use super::value::Type;
use crate::st::Profile;

impl RegisterId {
    /// The same value in the other profile, if it is possible in the other profile only. `value` is as
    /// [`decode`](Self::decode) returns it. Two kinds of registers show a wrong profile: a temperature
    /// or a power has no sign in the document and one in shipped firmware, and a share above 100 % is
    /// not possible (docs/SPEC-NOTES.md S12, S23).
    ///
    /// Other values of a wrong profile are not detected: 9.8 % may be 98 %.
    pub fn value_of_other_profile(self, profile: Profile, value: i32) -> Option<i32> {
        let shape = self.shape()?;
        let other = profile.other();
        if (shape.ty(profile), shape.ty(other)) == (Type::U16, Type::I16) {
            let signed = Type::I16.fit(value);
            return (signed < 0).then_some(signed);
        }
        let (most, most_in_other) = (shape.unit.most(profile)?, shape.unit.most(other)?);
        (value > most && value <= most_in_other).then_some(value)
    }
}
