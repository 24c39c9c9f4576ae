//! The account of energy.

/// Energies since the start, J. They balance:
/// `source = supply + board + chopper + switching + copper + iron + friction + gear + load + stored`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    /// From the source, and from a second feed of the bus.
    pub source: f64,
    /// Heat of the source's resistance.
    pub supply: f64,
    /// Into the board's electronics.
    pub board: f64,
    /// Heat of the brake resistor.
    pub chopper: f64,
    /// Through the motor's terminals; part of the following energies.
    pub electrical: f64,
    /// Heat of windings and closed switches.
    pub copper: f64,
    /// Switching losses of the power stage.
    pub switching: f64,
    /// Iron losses.
    pub iron: f64,
    /// Heat of the rotor's friction.
    pub friction: f64,
    /// Heat of the gear.
    pub gear: f64,
    /// Into the driven load.
    pub load: f64,
    /// Gained by capacitor, windings, rotor, springs and weights.
    pub stored: f64,
}

/// Power that becomes heat, mean of the last millisecond, W.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Losses {
    /// In the windings.
    pub winding: f32,
    /// In the power stage: closed switches and switching.
    pub inverter: f32,
    /// Of the iron.
    pub iron: f32,
    /// Of the rotor's friction.
    pub friction: f32,
    /// In the gear.
    pub gear: f32,
    /// In the brake resistor.
    pub chopper: f32,
}

impl Energy {
    /// The sum of all losses and outputs.
    pub fn spent(&self) -> f64 {
        let bus = self.supply + self.board + self.chopper + self.switching;
        bus + self.copper + self.iron + self.friction + self.gear + self.load
    }

    /// The error of the balance, relative to the total energy.
    pub fn imbalance(&self) -> f64 {
        let heat = self.spent() - self.load;
        let turned_over = self.source.abs() + heat + self.load.abs() + self.stored.abs();
        if turned_over == 0.0 {
            return 0.0;
        }
        (self.source - self.spent() - self.stored) / turned_over
    }
}
