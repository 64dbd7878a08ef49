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
}
