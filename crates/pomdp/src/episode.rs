//! Recorded interaction.

/// One recorded step: the action, and what it brought.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Transition<A, O> {
    /// Executed action.
    pub action: A,
    /// Observation received after it.
    pub observation: O,
    /// Reward of the step.
    pub reward: f64,
}

/// Σ γ^t r_t of a sequence of rewards.
///
/// # Example
///
/// ```
/// assert_eq!(pomdp::discounted_return([1.0, 2.0, 4.0], 0.5), 3.0);
/// ```
#[must_use]
pub fn discounted_return(rewards: impl IntoIterator<Item = f64>, discount: f64) -> f64 {
    let mut weight = 1.0;
    let mut total = 0.0;
    for reward in rewards {
        total += weight * reward;
        weight *= discount;
    }
    total
}
