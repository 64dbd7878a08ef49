//! Wall-clock times of trials: the only place with a clock, and nothing depends on what it says.

use std::time::Instant;

use agent::{Error, World, WorldStep};
use push_task::{Action, Observation, Particle};

/// A clock that was started.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stopwatch(Instant);

impl Stopwatch {
    #[expect(clippy::disallowed_methods, reason = "a program may time its trials; nothing depends on it")]
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    pub(crate) fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Times that decisions took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DecisionTimes {
    /// All of them, s.
    pub(crate) sum_secs: f64,
    /// The slowest, s.
    pub(crate) slowest_secs: f64,
}

/// A world that notes how long it waits for each action: what an agent needs to update its belief and to search. The world's own time does
/// not count.
pub(crate) struct Timed<'a, W> {
    world: &'a mut W,
    answered: Option<Stopwatch>,
    times: DecisionTimes,
}

impl<'a, W: World> Timed<'a, W> {
    pub(crate) fn new(world: &'a mut W) -> Self {
        Self { world, answered: None, times: DecisionTimes::default() }
    }

    pub(crate) fn times(&self) -> DecisionTimes {
        self.times
    }
}

impl<W: World> World for Timed<'_, W> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
        let answer = self.world.reset();
        self.answered = Some(Stopwatch::start());
        answer
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, Error> {
        if let Some(answered) = self.answered {
            let secs = answered.seconds();
            self.times.sum_secs += secs;
            self.times.slowest_secs = self.times.slowest_secs.max(secs);
        }
        let answer = self.world.act(action);
        self.answered = Some(Stopwatch::start());
        answer
    }

    fn truth(&self) -> Option<&Particle> {
        self.world.truth()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use pomdp::Outcome;

    use super::*;

    struct Slow;

    impl World for Slow {
        fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
            Ok((Observation(Vec::new()), Vec::new()))
        }

        fn act(&mut self, _: Action) -> Result<WorldStep, Error> {
            std::thread::sleep(Duration::from_millis(50));
            let (observation, joints_rad) = self.reset()?;
            let report = push_task::ActionReport::default();
            Ok(WorldStep { observation, joints_rad, reward: 0.0, outcome: Outcome::Continue, report })
        }

        fn truth(&self) -> Option<&Particle> {
            None
        }
    }

    #[test]
    fn decisions_are_timed_without_the_world() {
        let mut world = Slow;
        let mut timed = Timed::new(&mut world);
        timed.reset().unwrap();
        for thinking_millis in [20, 5] {
            std::thread::sleep(Duration::from_millis(thinking_millis));
            timed.act(Action::ALL[0]).unwrap();
        }
        // A sleep lasts at least as long as asked for; how much longer, nobody promises.
        let times = timed.times();
        assert!(times.sum_secs >= 0.025 && times.slowest_secs >= 0.02, "{times:?}");
        assert!(times.slowest_secs <= times.sum_secs, "{times:?}");
    }
}
