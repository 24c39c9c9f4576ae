//! Features of a drive's firmware build.

macro_rules! features {
    ($( $name:ident $text:literal; )+) => {
        /// A build option. A drive has a register only if it is built with the register's feature.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Feature { $( #[doc = $text] $name, )+ }

        impl Feature {
            /// Every feature.
            pub const ALL: &'static [Feature] = &[$( Feature::$name, )+];

            /// The description of the feature.
            pub const fn name(self) -> &'static str {
                match self { $( Feature::$name => $text, )+ }
            }

            /// The feature with this discriminant.
            pub(super) const fn from_number(number: u8) -> Self {
                match number {
                    $( n if n == Feature::$name as u8 => Feature::$name, )+
                    _ => Feature::Core,
                }
            }
        }
    };
}

features! {
    Core "any drive";
    ObserverPll "state observer with PLL";
    ObserverCordic "state observer with CORDIC";
    PositionSensor "encoder or Hall sensors";
    FluxWeakening "flux weakening";
    FeedForward "feed-forward";
    Pfc "power factor correction";
    Dac "DAC";
    Hfi "high-frequency injection";
    Profiler "motor profiler";
    PositionControl "position control";
}

#[cfg(feature = "std")]
impl Feature {
    /// The feature on the command line and in files: `ObserverPll` is `observer-pll`.
    pub fn word(self) -> std::string::String {
        let mut word = std::string::String::new();
        for letter in std::format!("{self:?}").chars() {
            if letter.is_uppercase() && !word.is_empty() {
                word.push('-');
            }
            word.extend(letter.to_lowercase());
        }
        word
    }
}

/// A set of [`Feature`]s; [`Feature::Core`] is in every set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Features(u16);

impl Features {
    /// A drive without any optional feature.
    pub const NONE: Features = Features(1);

    /// The set with this feature added.
    pub const fn with(self, feature: Feature) -> Self {
        Features(self.0 | 1 << feature as u16)
    }

    /// Whether the drive has `feature`.
    pub const fn has(self, feature: Feature) -> bool {
        self.has_number(feature as u8)
    }

    /// Whether the drive has the feature with this discriminant.
    pub(super) const fn has_number(self, number: u8) -> bool {
        self.0.wrapping_shr(number as u32) & 1 != 0
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use std::string::String;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn every_feature_has_a_word_of_its_own() {
        let mut words: Vec<String> = Feature::ALL.iter().map(|feature| feature.word()).collect();
        assert!(words.iter().any(|word| word == "observer-pll"));
        words.sort();
        words.dedup();
        assert_eq!(words.len(), Feature::ALL.len());
    }
}
