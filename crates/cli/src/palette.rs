//! Colours of all pictures, on white. A colour has one meaning.

/// Red, green, blue.
pub type Colour = (u8, u8, u8);

/// Declares the meanings with their colours.
macro_rules! meanings {
    ($( $name:ident $colour:literal $doc:literal; )+) => {
        /// What a colour means.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Meaning { $( #[doc = $doc] $name, )+ }

        impl Meaning {
            #[cfg(test)]
            const ALL: &[Meaning] = &[$( Meaning::$name, )+];

            /// The colour.
            pub const fn colour(self) -> Colour {
                let rgb: u32 = match self { $( Meaning::$name => $colour, )+ };
                ((rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8)
            }
        }
    };
}

meanings! {
    Text 0x24292F "text";
    Event 0xA3ACB6 "the moment of an event; secondary text in lists";
    Grid 0xE4E7EB "lines of the grid, borders";
    Reference 0x6E7781 "what a controller is commanded to reach, whatever the quantity";
    Speed 0x0072B2 "speed, and control of speed";
    Position 0x5B3FD0 "an angle, and control of position";
    QAxis 0x008C8C "current and voltage of the q axis";
    DAxis 0x9C3DB0 "current and voltage of the d axis";
    Torque 0x7A7000 "torque of the motor, and control of torque";
    Load 0x3D1F66 "torque of the load";
    Supply 0xC98500 "voltage and current of the supply";
    Temperature 0xD0307A "a temperature";
    Loss 0x4E6E2E "a loss";
    PhaseA 0x33507A "phase a";
    PhaseB 0xA0645A "phase b";
    PhaseC 0x6F9A1F "phase c";
    Rest 0xCBD2D9 "off or at rest, no fault";
    Starting 0xE8B900 "a state on the way to running";
    Aligning 0x4FB6D6 "alignment of the encoder";
    Running 0x13803F "running";
    Stopping 0x8D99A6 "stopping, stopped with power";
    Fault 0xC43E00 "a fault";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_meanings_have_nearly_the_same_colour() {
        let distance = |a: Colour, b: Colour| {
            let square = |a: u8, b: u8| i32::from(a.abs_diff(b)).pow(2);
            square(a.0, b.0) + square(a.1, b.1) + square(a.2, b.2)
        };
        for (n, a) in Meaning::ALL.iter().enumerate() {
            for b in &Meaning::ALL[..n] {
                let apart = distance(a.colour(), b.colour());
                assert!(apart >= 20 * 20, "{a:?} and {b:?}: {apart}");
            }
        }
    }
}
