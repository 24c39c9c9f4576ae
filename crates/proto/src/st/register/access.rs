//! What may be done with a register.

/// The access that table 3 allows to a master.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Access {
    /// `RW`
    ReadWrite,
    /// `R`
    ReadOnly,
    /// `W`
    WriteOnly,
    /// `D`: only as the value of DAC_OUT1 and DAC_OUT2, and in data segments (SPEC-NOTES S5).
    Dac,
    /// Firmware has a name for it, but allows neither read nor write.
    Never,
}

impl Access {
    /// Every access.
    pub const ALL: [Access; 5] =
        [Access::ReadWrite, Access::ReadOnly, Access::WriteOnly, Access::Dac, Access::Never];

    /// What the letters mean.
    pub const fn doc(self) -> &'static str {
        match self {
            Access::ReadWrite => "read and write",
            Access::ReadOnly => "read only",
            Access::WriteOnly => "write only",
            Access::Dac => "in data segments and on DAC channels only",
            Access::Never => "named by firmware, neither read nor written",
        }
    }

    /// The letters of table 3; `-` for [`Access::Never`].
    pub const fn name(self) -> &'static str {
        match self {
            Access::ReadWrite => "RW",
            Access::ReadOnly => "R",
            Access::WriteOnly => "W",
            Access::Dac => "D",
            Access::Never => "-",
        }
    }

    /// The access with this discriminant.
    pub(super) const fn from_number(number: u8) -> Self {
        match number {
            n if n == Access::ReadWrite as u8 => Access::ReadWrite,
            n if n == Access::ReadOnly as u8 => Access::ReadOnly,
            n if n == Access::WriteOnly as u8 => Access::WriteOnly,
            n if n == Access::Dac as u8 => Access::Dac,
            _ => Access::Never,
        }
    }

    pub(super) const fn reads(self) -> bool {
        matches!(self, Access::ReadWrite | Access::ReadOnly)
    }

    pub(super) const fn writes(self) -> bool {
        matches!(self, Access::ReadWrite | Access::WriteOnly)
    }
}

/// The source of a row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Origin {
    /// Table 3 of the document.
    Table3,
    /// Firmware of MCSDK 5.x only: unknown in profile `spec`.
    Firmware,
}

/// How a slave handles a SET_REG of a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writing {
    /// Accepts a value of this many bytes.
    Takes(u8),
    /// Refuses: the register cannot be written.
    ReadOnly,
    /// Refuses: the drive is built without the feature, or refuses all values.
    Refused,
}
