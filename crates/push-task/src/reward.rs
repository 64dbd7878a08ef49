//! Rewards and terminal conditions.

use crate::config::{GoalConfig, RewardConfig};

/// What an action did, as far as the reward asks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Events {
    /// A force or torque above the limit.
    pub large_force: bool,
    /// The move would have left the reachable region.
    pub out_of_reach: bool,
    /// The object moved for the first time.
    pub first_moved: bool,
    /// The object's centre is in the goal region.
    pub goal: bool,
}

impl RewardConfig {
    /// Reward of an action.
    #[must_use]
    pub fn reward(&self, events: Events) -> f64 {
        let mut reward = self.step;
        for (happened, value) in [
            (events.large_force, self.large_force),
            (events.out_of_reach, self.out_of_reach),
            (events.first_moved, self.object_moved),
            (events.goal, self.goal),
        ] {
            if happened {
                reward += value;
            }
        }
        reward
    }
}

impl GoalConfig {
    /// Whether a point, m, base frame, lies over the goal region.
    #[must_use]
    pub fn contains(&self, position_m: [f64; 3]) -> bool {
        (position_m[0] - self.x_m).hypot(position_m[1] - self.y_m) <= self.radius_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rewards_add_up_as_designed() {
        let reward = RewardConfig {
            step: -1.0,
            large_force: -5.0,
            out_of_reach: -5.0,
            object_moved: 10.0,
            goal: 100.0,
            moved_threshold_m: 0.005,
        };
        assert_eq!(reward.reward(Events::default()), -1.0);
        assert_eq!(reward.reward(Events { large_force: true, ..Events::default() }), -6.0);
        assert_eq!(reward.reward(Events { out_of_reach: true, ..Events::default() }), -6.0);
        assert_eq!(reward.reward(Events { first_moved: true, goal: true, ..Events::default() }), 109.0);
    }
}
