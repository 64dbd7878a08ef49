//! The ten discrete tool moves and their minimum-jerk time course.

use serde::{Deserialize, Serialize};

/// Number of actions.
pub const ACTION_COUNT: usize = 10;

/// A relative move of the tool, by index: 0–7 in the xy plane counter-clockwise from +x in steps of 45°, 8 up, 9 down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct Action(u8);

impl Action {
    /// All actions, by index.
    pub const ALL: [Self; ACTION_COUNT] =
        [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5), Self(6), Self(7), Self(8), Self(9)];
    /// Up along z.
    pub const UP: Self = Self(8);
    /// Down along z.
    pub const DOWN: Self = Self(9);

    /// Index in [`Action::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// Unit direction of the move in the base frame.
    #[must_use]
    pub fn direction(self) -> [f64; 3] {
        match self.0 {
            8 => [0.0, 0.0, 1.0],
            9 => [0.0, 0.0, -1.0],
            index => {
                // Exact values for the axes and equal ones for the diagonals keep mirrored moves mirrored, bit for bit.
                const D: f64 = std::f64::consts::FRAC_1_SQRT_2;
                const XY: [[f64; 2]; 8] =
                    [[1.0, 0.0], [D, D], [0.0, 1.0], [-D, D], [-1.0, 0.0], [-D, -D], [0.0, -1.0], [D, -D]];
                let [x, y] = XY[index as usize];
                [x, y, 0.0]
            }
        }
    }
}

impl TryFrom<u8> for Action {
    type Error = String;

    fn try_from(index: u8) -> Result<Self, String> {
        if usize::from(index) < ACTION_COUNT {
            Ok(Self(index))
        } else {
            Err(format!("action {index} does not exist: 0 to {} do", ACTION_COUNT - 1))
        }
    }
}

impl From<Action> for u8 {
    fn from(action: Action) -> Self {
        action.0
    }
}

/// Share of a minimum-jerk move that is done after the share `time` in [0, 1] of its duration (Flash and Hogan 1985):
/// 10 t³ − 15 t⁴ + 6 t⁵.
#[must_use]
pub fn minimum_jerk(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// First derivative of [`minimum_jerk`] by `time`: 30 t² (1 − t)².
#[must_use]
pub fn minimum_jerk_rate(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    30.0 * t * t * (1.0 - t) * (1.0 - t)
}

/// Second derivative of [`minimum_jerk`] by `time`: 60 t (1 − t) (1 − 2 t).
#[must_use]
pub fn minimum_jerk_acceleration(time: f64) -> f64 {
    let t = time.clamp(0.0, 1.0);
    60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_unit_vectors_and_opposites_cancel() {
        for action in Action::ALL {
            let d = action.direction();
            assert!((d.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
        }
        for i in 0..4 {
            let (a, b) = (Action::ALL[i].direction(), Action::ALL[i + 4].direction());
            assert!(a.iter().zip(b).all(|(x, y)| x + y == 0.0), "{a:?} {b:?}");
        }
        assert!(Action::try_from(10).is_err());
    }

    #[test]
    fn minimum_jerk_starts_and_ends_at_rest_with_no_acceleration() {
        let h = 1e-4;
        for t in [0.1, 0.4, 0.7] {
            let rate = (minimum_jerk(t + h) - minimum_jerk(t - h)) / (2.0 * h);
            let acceleration = (minimum_jerk_rate(t + h) - minimum_jerk_rate(t - h)) / (2.0 * h);
            assert!((rate - minimum_jerk_rate(t)).abs() < 1e-6);
            assert!((acceleration - minimum_jerk_acceleration(t)).abs() < 1e-5);
        }
        assert_eq!(minimum_jerk(0.0), 0.0);
        assert_eq!(minimum_jerk(1.0), 1.0);
        assert!((minimum_jerk(0.5) - 0.5).abs() < 1e-15);
        // Velocity 1.875 of the mean at the middle (closed form), 0 at the ends; acceleration O(h) at the ends.
        assert!(((minimum_jerk(0.5 + h) - minimum_jerk(0.5 - h)) / (2.0 * h) - 1.875).abs() < 1e-6);
        assert!(minimum_jerk(h) / h < 1e-6);
        assert!((1.0 - minimum_jerk(1.0 - h)) / h < 1e-6);
    }
}
