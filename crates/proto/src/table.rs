//! The macro for all lists of named numbers. Each number is written once; unknown numbers are kept.

/// Declares a set of named numbers: the enum, both conversions, the document's names and the list.
/// A number without a name becomes `Unknown`.
macro_rules! named_numbers {
    (
        $(#[$meta:meta])*
        pub enum $name:ident: $repr:ident {
            $( $value:literal $variant:ident $text:literal $doc:literal; )+
        }
    ) => {
        $(#[$meta])*
        // The discriminants are the numbers, so that conversions need no tables.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr($repr)]
        pub enum $name {
            $( #[doc = concat!("`", $text, "` (", stringify!($value), "): ", $doc)]
               $variant = $value, )+
            /// A number without a name in the document.
            Unknown($repr) = $repr::MAX,
        }

        impl $name {
            /// Every named value, in the order of the table.
            pub const ALL: &'static [$name] = &[$( $name::$variant, )+];

            /// Each number with the document's name for it.
            pub const NAMES: &'static [($repr, &'static str)] = &[$( ($value, $text), )+];

            /// The document's name; `None` if it has none.
            pub const fn name(self) -> Option<&'static str> {
                match self {
                    $( $name::$variant => Some($text), )+
                    $name::Unknown(_) => None,
                }
            }

            /// The number on the wire.
            pub const fn number(self) -> $repr {
                match self {
                    $( $name::$variant => $value, )+
                    $name::Unknown(other) => other,
                }
            }

            /// What the value means, in a sentence.
            pub const fn doc(self) -> &'static str {
                match self {
                    $( $name::$variant => $doc, )+
                    $name::Unknown(_) => "no document names this number",
                }
            }
        }

        impl From<$repr> for $name {
            fn from(number: $repr) -> Self {
                match number {
                    $( $value => $name::$variant, )+
                    other => $name::Unknown(other),
                }
            }
        }

        impl From<$name> for $repr {
            fn from(value: $name) -> Self {
                value.number()
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self.name() {
                    Some(name) => f.write_str(name),
                    None => write!(f, "{:#04x}", <$repr>::from(*self)),
                }
            }
        }
    };
}
