//! Vectors of two-phase quantities, and their frames.

use core::ops::{Add, Mul, Neg, Sub};

use crate::angle::{DIGIT, sin_cos};

/// Half the square root of three.
pub(crate) const HALF_SQRT_3: f32 = 0.866_025_4;
/// One over the square root of three: the maximum phase voltage per bus voltage.
pub(crate) const INVERSE_SQRT_3: f32 = 0.577_350_26;

/// Two perpendicular components: alpha and beta in the stator's frame, d and q in the rotor's.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vector {
    /// Alpha, along phase A; or d, along the magnet.
    pub x: f32,
    /// Beta, or q: a quarter of an electrical turn ahead.
    pub y: f32,
}

impl Vector {
    /// The zero vector.
    pub const ZERO: Vector = Vector::new(0.0, 0.0);

    /// A vector with these components.
    pub const fn new(x: f32, y: f32) -> Self {
        Vector { x, y }
    }

    /// A unit vector at an angle of 2^32 a turn.
    pub fn unit(angle: u32) -> Self {
        let (y, x) = sin_cos(angle);
        Vector { x, y }
    }

    /// The angle, 2^32 a turn, within 1e-5 rad; 0 for the zero vector.
    /// The angle is folded to an eighth of a turn, for which a polynomial approximates the
    /// arctangent (Abramowitz and Stegun, *Handbook of Mathematical Functions*, 4.4.49).
    pub fn angle(self) -> u32 {
        const QUARTER: f32 = (1 << 30) as f32;
        let (x, y) = (self.x.abs(), self.y.abs());
        let (least, most) = if x < y { (x, y) } else { (y, x) };
        if most == 0.0 {
            return 0;
        }
        let t = least / most;
        let z = t * t;
        let series =
            0.999_866 + z * (-0.330_299_5 + z * (0.180_141 + z * (-0.085_133 + z * 0.020_835_1)));
        let folded = t * series * (1.0 / DIGIT);
        let first = (if x < y { QUARTER - folded } else { folded }) as i32 as u32;
        let ahead = if self.x < 0.0 { (1u32 << 31).wrapping_sub(first) } else { first };
        if self.y < 0.0 { ahead.wrapping_neg() } else { ahead }
    }

    /// The vector rotated forwards by the angle of the unit vector `frame`: from the rotor's frame
    /// to the stator's (inverse Park transform).
    pub fn turned(self, frame: Vector) -> Self {
        Vector { x: self.x * frame.x - self.y * frame.y, y: self.x * frame.y + self.y * frame.x }
    }

    /// The vector in the frame of the unit vector `frame`: from the stator's frame to the rotor's
    /// (Park transform).
    pub fn seen_from(self, frame: Vector) -> Self {
        self.turned(Vector { y: -frame.y, ..frame })
    }

    /// From phases A and B of three whose sum is zero; keeps amplitudes (Clarke transform).
    pub fn from_phases(a: f32, b: f32) -> Self {
        Vector { x: a, y: (a + 2.0 * b) * INVERSE_SQRT_3 }
    }

    /// Phases A, B and C (inverse Clarke transform).
    pub fn phases(self) -> [f32; 3] {
        let (half, side) = (-0.5 * self.x, HALF_SQRT_3 * self.y);
        [self.x, half + side, half - side]
    }

    /// Each component times its own factor.
    pub fn scaled(self, factors: Vector) -> Self {
        Vector { x: self.x * factors.x, y: self.y * factors.y }
    }

    /// Each component plus a fraction of it.
    pub fn grown(self, shares: Vector) -> Self {
        self + self.scaled(shares)
    }

    /// Scalar product.
    pub fn dot(self, other: Vector) -> f32 {
        self.x * other.x + self.y * other.y
    }

    /// Component of the vector product: positive when `other` is ahead.
    pub fn cross(self, other: Vector) -> f32 {
        self.x * other.y - self.y * other.x
    }

    /// Length squared.
    pub fn square(self) -> f32 {
        self.dot(self)
    }

    /// Length.
    pub fn length(self) -> f32 {
        libm::sqrtf(self.square())
    }
}

impl Add for Vector {
    type Output = Vector;
    fn add(self, other: Vector) -> Vector {
        Vector { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Sub for Vector {
    type Output = Vector;
    fn sub(self, other: Vector) -> Vector {
        Vector { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Neg for Vector {
    type Output = Vector;
    fn neg(self) -> Vector {
        Vector { x: -self.x, y: -self.y }
    }
}

impl Mul<f32> for Vector {
    type Output = Vector;
    fn mul(self, factor: f32) -> Vector {
        Vector { x: self.x * factor, y: self.y * factor }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vectors_angle_is_found_all_around() {
        for angle in (0..100_000u32).map(|step| step.wrapping_mul(42_949_673)) {
            let found = (Vector::unit(angle) * 3.0).angle();
            let off = found.wrapping_sub(angle) as i32 as f32 * DIGIT;
            assert!(off.abs() < 2e-5, "{angle:#x}: {off} rad");
        }
        assert_eq!(Vector::ZERO.angle(), 0);
    }

    #[test]
    fn transforms_keep_amplitudes_and_have_inverses() {
        let vector = Vector::new(3.0, -4.0);
        let [a, b, c] = vector.phases();
        assert!((a + b + c).abs() < 1e-6);
        let again = Vector::from_phases(a, b);
        assert!((again - vector).length() < 1e-6);
        let frame = Vector::unit(0x1234_5678);
        assert!((vector.turned(frame).seen_from(frame) - vector).length() < 1e-5);
        assert!((vector.turned(frame).length() - 5.0).abs() < 1e-5);
        assert!(Vector::new(1.0, 0.0).cross(Vector::unit(1 << 30)) > 0.99);
    }
}
