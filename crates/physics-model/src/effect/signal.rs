//! Effects on signals: commands on their way to the arm, forces and poses on their way from the sensors. One value a control step.

use std::collections::VecDeque;

use super::{Effect, Hooks};
use crate::state::{BodyState, MAX_JOINTS};
use crate::world::Wrench;

/// In which coordinates commands are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandSpace {
    /// Tool centre, m, base frame: three values.
    Tool,
    /// Joint positions, rad.
    Joints,
}

/// Where a stretch of commands begins, the arm at rest.
#[derive(Clone, Copy, Debug)]
pub struct CommandStart<'a> {
    /// Coordinates.
    pub space: CommandSpace,
    /// The first command.
    pub at: &'a [f64],
    /// Duration of a control step, s.
    pub period_secs: f64,
    /// Where the joints stand in their play, rad (see [`super::Memory::play_rad`]).
    pub play_rad: [f64; MAX_JOINTS],
}

/// An effect on commands while an action or an episode runs.
pub trait CommandFilter: Send + std::fmt::Debug {
    /// What is commanded for the end of the coming control step, to what the next stage gets: changed in place.
    fn apply(&mut self, signal: &mut [f64]);

    /// Where the joints stand in their play, rad, if this is about play.
    fn play_rad(&self) -> Option<[f64; MAX_JOINTS]> {
        None
    }

    /// How many control steps after the last command the arm gets to its end.
    fn settling_steps(&self) -> u32 {
        0
    }
}

/// How the tool moves at the end of a control step, for sensors that it carries.
#[derive(Clone, Copy, Debug)]
pub struct ToolMoment {
    /// Time since the episode began, s.
    pub time_secs: f64,
    /// Unit quaternion x, y, z, w of R(base ← tool).
    pub orientation: [f64; 4],
    /// Acceleration of the tool centre, m/s², base axes.
    pub acceleration_mps2: [f64; 3],
    /// Magnitude of gravity, m/s², along −z.
    pub gravity_mps2: f64,
}

/// An effect on the force readings while an action or an episode runs.
pub trait ForceFilter: Send + std::fmt::Debug {
    /// Wrench about the tool centre, base axes, as it would be read without the effect, to how it is read: changed in place.
    fn apply(&mut self, moment: &ToolMoment, wrench: &mut Wrench);
}

/// All effects on commands, in the order of the list.
#[derive(Debug, Default)]
pub struct CommandChain(Vec<Box<dyn CommandFilter>>);

impl CommandChain {
    /// The chain of `effects` from `start` on; `None` where no effect touches commands.
    #[must_use]
    pub fn new(effects: &[Box<dyn Effect>], start: &CommandStart) -> Option<Self> {
        Hooks::of(effects)
            .contains(Hooks::COMMAND)
            .then(|| Self(effects.iter().filter_map(|effect| effect.command(start)).collect()))
    }

    /// As [`Self::new`], of the effects that have any of `hooks`, or of those that have none of them.
    #[must_use]
    pub fn of_those(effects: &[Box<dyn Effect>], start: &CommandStart, hooks: Hooks, with: bool) -> Option<Self> {
        let those = effects.iter().filter(|effect| effect.hooks().contains(hooks) == with);
        let chain: Vec<_> = those.filter_map(|effect| effect.command(start)).collect();
        (!chain.is_empty()).then_some(Self(chain))
    }

    /// The command of the coming control step, in place, to where the drives go.
    pub fn apply(&mut self, signal: &mut [f64]) {
        for filter in &mut self.0 {
            filter.apply(signal);
        }
    }

    /// Where the joints stand in their play, rad.
    #[must_use]
    pub fn play_rad(&self) -> Option<[f64; MAX_JOINTS]> {
        self.0.iter().find_map(|filter| filter.play_rad())
    }

    /// How many control steps after the last command the arm gets to its end.
    #[must_use]
    pub fn settling_steps(&self) -> u32 {
        self.0.iter().map(|filter| filter.settling_steps()).sum()
    }
}

/// All effects on force readings, in the order of the list.
#[derive(Debug, Default)]
pub struct ForceChain(Vec<Box<dyn ForceFilter>>);

impl ForceChain {
    /// The chain of `effects` for readings every `period_secs`; `None` where no effect touches forces.
    #[must_use]
    pub fn new(effects: &[Box<dyn Effect>], period_secs: f64) -> Option<Self> {
        Hooks::of(effects)
            .contains(Hooks::FORCE)
            .then(|| Self(effects.iter().filter_map(|effect| effect.force(period_secs)).collect()))
    }

    /// The wrench at the end of a control step, in place, to how it is read.
    pub fn apply(&mut self, moment: &ToolMoment, wrench: &mut Wrench) {
        for filter in &mut self.0 {
            filter.apply(moment, wrench);
        }
    }
}

/// All effects on the readings of one body's pose.
#[derive(Clone, Debug)]
pub struct PoseChain(Option<DelayLine<BodyState>>);

impl PoseChain {
    /// For a body that has rested at `first` until now, read every `period_secs`.
    #[must_use]
    pub fn new(effects: &[Box<dyn Effect>], period_secs: f64, first: &BodyState) -> Self {
        Self(Hooks::of(effects).contains(Hooks::POSE_DELAY).then(|| {
            let delay_secs = effects.iter().map(|effect| effect.pose_delay_secs()).sum();
            DelayLine::new(delay_secs, period_secs, *first)
        }))
    }

    /// What is read at the end of a control step of a body that is at `body` by then.
    pub fn read(&mut self, effects: &[Box<dyn Effect>], body: &BodyState) -> BodyState {
        read(effects, &self.seen(body))
    }

    /// The delay alone.
    pub fn seen(&mut self, body: &BodyState) -> BodyState {
        self.0.as_mut().map_or(*body, |line| line.push(*body))
    }
}

/// What the pose sensor says of a body at this moment, without delay.
#[must_use]
pub fn read(effects: &[Box<dyn Effect>], body: &BodyState) -> BodyState {
    let mut read = *body;
    // One that does nothing need not even round.
    for effect in effects.iter().filter(|effect| effect.hooks().contains(Hooks::POSE)) {
        effect.read(&mut read);
    }
    read
}

/// The state behind a reading: inverse of [`read`]. A log's first row goes through this before it becomes a world.
#[must_use]
pub fn unread(effects: &[Box<dyn Effect>], reading: &BodyState) -> BodyState {
    let mut body = *reading;
    for effect in effects.iter().rev().filter(|effect| effect.hooks().contains(Hooks::POSE)) {
        effect.unread(&mut body);
    }
    body
}

/// Something that can be delayed by a time between two samples.
pub trait Blend: Clone {
    /// The value after the share `share` in [0, 1] of the way to `later`.
    #[must_use]
    fn blend(&self, later: &Self, share: f64) -> Self;
}

impl Blend for [f64; MAX_JOINTS] {
    fn blend(&self, later: &Self, share: f64) -> Self {
        std::array::from_fn(|i| self[i] + share * (later[i] - self[i]))
    }
}

impl Blend for Wrench {
    fn blend(&self, later: &Self, share: f64) -> Self {
        let mut blend = Self::default();
        blend.add_scaled(self, 1.0 - share);
        blend.add_scaled(later, share);
        blend
    }
}

impl Blend for BodyState {
    fn blend(&self, later: &Self, share: f64) -> Self {
        let (a, mut b) = (self.to_array(), later.to_array());
        // A rotation has two quaternions: the nearer one.
        if (3..7).map(|i| a[i] * b[i]).sum::<f64>() < 0.0 {
            for value in &mut b[3..7] {
                *value = -*value;
            }
        }
        let mut mixed: [f64; crate::state::BODY_LEN] = std::array::from_fn(|i| a[i] + share * (b[i] - a[i]));
        let norm = mixed[3..7].iter().map(|v| v * v).sum::<f64>().sqrt();
        for value in &mut mixed[3..7] {
            *value /= norm;
        }
        Self::from_array(&mixed)
    }
}

/// A delay of a whole or broken number of samples; before the first one its value held.
#[derive(Clone, Debug)]
pub struct DelayLine<T> {
    samples: VecDeque<T>,
    whole: usize,
    broken: f64,
}

impl<T: Blend> DelayLine<T> {
    /// Delays by `delay_secs` what comes every `period_secs`; `first` held until now.
    #[must_use]
    pub fn new(delay_secs: f64, period_secs: f64, first: T) -> Self {
        let delay = delay_secs / period_secs;
        let whole = delay.floor() as usize;
        let mut samples = VecDeque::with_capacity(whole + 3);
        samples.resize(whole + 2, first);
        Self { samples, whole, broken: delay - delay.floor() }
    }

    /// Takes the newest sample and gives the one of the delay ago.
    pub fn push(&mut self, sample: T) -> T {
        self.samples.pop_front();
        self.samples.push_back(sample);
        // The newest sample is the last of `whole + 2`.
        let later = &self.samples[1];
        if self.broken == 0.0 { later.clone() } else { later.blend(&self.samples[0], self.broken) }
    }

    /// How many samples it takes until the newest one has come through.
    #[must_use]
    pub fn length(&self) -> u32 {
        self.whole as u32 + u32::from(self.broken > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_line_shifts_a_ramp_by_its_delay() {
        for delay_secs in [0.0, 0.01, 0.025, 0.04] {
            let mut line = DelayLine::new(delay_secs, 0.01, [0.0; MAX_JOINTS]);
            for step in 1..=20 {
                let time = 0.01 * f64::from(step);
                let value = line.push([3.0 * time; MAX_JOINTS])[0];
                let expected = 3.0 * (time - delay_secs).max(0.0);
                assert!((value - expected).abs() < 1e-12, "{delay_secs} {time}: {value} {expected}");
            }
            assert_eq!(f64::from(line.length()), (delay_secs / 0.01).ceil());
        }
    }

    #[test]
    fn poses_blend_along_the_shorter_way() {
        let from = BodyState::at_rest([0.0; 3], 0.2);
        let mut to = BodyState::at_rest([0.0, 0.4, 0.0], 0.4);
        to.orientation = to.orientation.map(|v| -v);
        let middle = from.blend(&to, 0.5);
        assert!((middle.yaw_rad() - 0.3).abs() < 1e-12 && (middle.position_m[1] - 0.2).abs() < 1e-12, "{middle:?}");
    }
}
