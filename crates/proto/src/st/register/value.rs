//! Types of register values.

/// Type of a register's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    /// IEEE 754 single precision; firmware only.
    F32,
}

impl Type {
    /// The type with this discriminant.
    pub(super) const fn from_number(number: u8) -> Self {
        match number {
            n if n == Type::I8 as u8 => Type::I8,
            n if n == Type::U8 as u8 => Type::U8,
            n if n == Type::I16 as u8 => Type::I16,
            n if n == Type::U16 as u8 => Type::U16,
            n if n == Type::I32 as u8 => Type::I32,
            n if n == Type::U32 as u8 => Type::U32,
            _ => Type::F32,
        }
    }

    /// The integer type of this size and sign.
    pub(super) const fn integer(size: u8, signed: bool) -> Self {
        match (size, signed) {
            (1, true) => Type::I8,
            (1, false) => Type::U8,
            (2, true) => Type::I16,
            (2, false) => Type::U16,
            (_, true) => Type::I32,
            (_, false) => Type::U32,
        }
    }

    /// The name in Rust and in the table, such as `i16`.
    pub const fn name(self) -> &'static str {
        match self {
            Type::I8 => "i8",
            Type::U8 => "u8",
            Type::I16 => "i16",
            Type::U16 => "u16",
            Type::I32 => "i32",
            Type::U32 => "u32",
            Type::F32 => "f32",
        }
    }

    /// Size on the wire: 1, 2 or 4 bytes.
    pub const fn size(self) -> u8 {
        match self {
            Type::I8 | Type::U8 => 1,
            Type::I16 | Type::U16 => 2,
            Type::I32 | Type::U32 | Type::F32 => 4,
        }
    }

    /// Cuts the value to the type's size and extends its sign.
    pub const fn fit(self, bits: i32) -> i32 {
        match self {
            Type::I8 => bits as i8 as i32,
            Type::U8 => bits as u8 as i32,
            Type::I16 => bits as i16 as i32,
            Type::U16 => bits as u16 as i32,
            Type::I32 | Type::U32 | Type::F32 => bits,
        }
    }

    /// Whether the type has negative values.
    pub const fn signed(self) -> bool {
        !matches!(self, Type::U8 | Type::U16 | Type::U32)
    }
}

/// A Rust type of a register's value. Functions pass register values as 32 bits: two's complement,
/// or the IEEE 754 bits of an `f32`.
pub trait Value: Copy {
    /// The table's type.
    const TYPE: Type;
    /// From the 32 bits of a function argument.
    fn from_bits(bits: i32) -> Self;
    /// To the 32 bits of a function argument.
    fn bits(self) -> i32;
}

macro_rules! integer_values {
    ($($rust:ident $ty:ident),+) => { $(
        impl Value for $rust {
            const TYPE: Type = Type::$ty;
            fn from_bits(bits: i32) -> Self { bits as $rust }
            fn bits(self) -> i32 { self as i32 }
        }
    )+ };
}

integer_values!(i8 I8, u8 U8, i16 I16, u16 U16, i32 I32, u32 U32);

impl Value for f32 {
    const TYPE: Type = Type::F32;
    fn from_bits(bits: i32) -> Self {
        f32::from_bits(bits as u32)
    }
    fn bits(self) -> i32 {
        self.to_bits() as i32
    }
}
