//! A gear that gives or has play, between a motor whose angle is read and its link.
//!
//! The link moves by itself where the gear does not hold it. With the motor's angle q as it was read, the link's angle is q + d, and
//! M d̈ + K d = g(d, ḋ) − τ (Spong 1987). τ is the torque that the gear would have to pass on if it were stiff, M the inertia about the joint and K the
//! change of τ with the angle. g is the gear's own torque: −k d − c ḋ of a spring, and the same beyond the flanks where there is play.

use crate::prepared::Prepared;

/// Longest step of the integration, s. Steps are implicit, which damps what is quicker; windows of 0.04 s do not show it anyway.
const STEP_SECS: f64 = 0.001;

/// Time over which the rate of a link is taken that moves when its log begins, s.
const START_SECS: f64 = 0.1;

/// What holds a link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gear {
    /// N·m/rad.
    pub(crate) stiffness: f64,
    /// From flank to flank, rad; 0 where there is none.
    pub(crate) play: f64,
    /// Share of critical damping.
    pub(crate) damping_ratio: f64,
}

/// How far a link is behind its motor, rad, and the second derivative of that, for each tick.
pub(crate) struct Lag {
    pub(crate) angle: Vec<f64>,
    pub(crate) second: Vec<f64>,
}

/// The lag of a joint's link behind its motor.
pub(crate) fn lag(prepared: &Prepared, joint: usize, gear: Gear) -> Lag {
    let count = prepared.ticks.count();
    let (mut angle, mut second) = (vec![0.0; count], vec![0.0; count]);
    let gain = prepared.gain(joint);
    let motor = prepared.reflected_inertia(joint);
    for span in prepared.ticks.spans() {
        let at = |tick: usize| {
            let passed = prepared.rigid[joint][tick] / gain - motor * prepared.motion[joint].acceleration[tick];
            let inertia = (prepared.inertia[joint][joint][tick] / gain).max(1e-9);
            Link { passed, inertia, slope: prepared.stiffness[joint][joint][tick] / gain }
        };
        let Some(first) = span.clone().next() else { continue };
        // A log may begin in the midst of a motion: the gear then gives as it would under a torque that changes slowly.
        let begun = prepared.ticks.time_secs[first];
        let soon = |tick: &usize| prepared.ticks.time_secs[*tick] - begun < START_SECS;
        let later = span.clone().find(|tick| !soon(tick)).unwrap_or(first);
        let apart = prepared.ticks.time_secs[later] - begun;
        let (start, then) = (gear.rest(&at(first)), gear.rest(&at(later)));
        let held = gear.play == 0.0 || start.side == then.side;
        let rate = if apart > 0.0 && held { (then.angle - start.angle) / apart } else { 0.0 };
        let mut state = Ahead { angle: start.angle, rate };
        for tick in span.clone() {
            let next = tick + 1;
            let secs =
                if next < span.end { prepared.ticks.time_secs[next] - prepared.ticks.time_secs[tick] } else { 0.0 };
            angle[tick] = -state.angle;
            if secs <= 0.0 || !secs.is_finite() {
                continue;
            }
            let (link, rate) = (at(tick), state.rate);
            let steps = (secs / STEP_SECS).ceil().max(1.0);
            for _ in 0..steps as usize {
                state = gear.stepped(state, &link, secs / steps);
            }
            second[tick] = -(state.rate - rate) / secs;
        }
    }
    Lag { angle, second }
}

/// A link at a tick.
struct Link {
    passed: f64,
    inertia: f64,
    slope: f64,
}

/// Where a link rests, and at which flank: 1 or −1.
struct Rest {
    angle: f64,
    side: f64,
}

/// Where a link is ahead of its motor, rad, and how fast, rad/s.
#[derive(Clone, Copy)]
struct Ahead {
    angle: f64,
    rate: f64,
}

impl Gear {
    /// Stiffness and damping of the link's motion, and half of the play.
    fn constants(self, inertia: f64) -> (f64, f64, f64) {
        (self.stiffness, 2.0 * self.damping_ratio * (self.stiffness * inertia).sqrt(), 0.5 * self.play)
    }

    /// Held still under the torque of a tick.
    fn rest(self, link: &Link) -> Rest {
        let (stiffness, _, half) = self.constants(link.inertia);
        let side = if link.passed > 0.0 { -1.0 } else { 1.0 };
        Rest { angle: side * half - link.passed / stiffness, side }
    }

    /// One step; forces of the flanks are implicit, so that no stiffness is too large for it.
    fn stepped(self, Ahead { angle, rate }: Ahead, link: &Link, secs: f64) -> Ahead {
        let (stiffness, damping, half) = self.constants(link.inertia);
        let free = -(link.passed + link.slope * angle) / link.inertia;
        let beyond = angle - angle.clamp(-half, half);
        if half > 0.0 && beyond == 0.0 {
            let rate = rate + free * secs;
            return Ahead { angle: angle + rate * secs, rate };
        }
        let inverse = 1.0 + secs * (damping + secs * stiffness) / link.inertia;
        let next = (rate + secs * (free - stiffness * beyond / link.inertia)) / inverse;
        // A flank pushes and does not pull.
        let torque = link.inertia * (next - rate) / secs - link.inertia * free;
        let next = if half > 0.0 && torque * beyond > 0.0 { rate + free * secs } else { next };
        Ahead { angle: angle + next * secs, rate: next }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(gear: Gear, link: &Link) -> Ahead {
        Ahead { angle: gear.rest(link).angle, rate: 0.0 }
    }

    fn run(gear: Gear, start: Ahead, passed: impl Fn(f64) -> f64, secs: f64) -> Vec<Ahead> {
        let mut states = vec![start];
        for step in 0..(secs / STEP_SECS) as usize {
            let link = Link { passed: passed(step as f64 * STEP_SECS), inertia: 2.0, slope: 0.0 };
            states.push(gear.stepped(*states.last().unwrap(), &link, STEP_SECS));
        }
        states
    }

    #[test]
    fn a_spring_gives_by_torque_over_stiffness() {
        let gear = Gear { stiffness: 1000.0, play: 0.0, damping_ratio: 0.02 };
        let start = still(gear, &Link { passed: 5.0, inertia: 2.0, slope: 0.0 });
        assert!((start.angle + 0.005).abs() < 1e-12);
        let last = *run(gear, start, |_| 5.0, 1.0).last().unwrap();
        assert!((last.angle + 0.005).abs() < 1e-9 && last.rate.abs() < 1e-9);
    }

    #[test]
    fn no_gear_is_too_stiff_and_no_link_too_light() {
        let gear = Gear { stiffness: 1e7, play: 0.001, damping_ratio: 0.5 };
        let link = Link { passed: 1.0, inertia: 1e-4, slope: 0.0 };
        let mut state = still(gear, &link);
        assert!((state.angle + 0.0005 + 1e-7).abs() < 1e-12, "{}", state.angle);
        for _ in 0..1000 {
            state = gear.stepped(state, &link, STEP_SECS);
        }
        assert!((state.angle + 0.0005 + 1e-7).abs() < 1e-10 && state.rate.abs() < 1e-9);
    }

    #[test]
    fn a_spring_swings_at_its_frequency() {
        // √(k/M) = 22.4 rad/s: a period of 0.281 s.
        let states = run(
            Gear { stiffness: 1000.0, play: 0.0, damping_ratio: 0.02 },
            Ahead { angle: 0.01, rate: 0.0 },
            |_| 0.0,
            1.2,
        );
        let signs = states.windows(2).filter(|pair| pair[0].angle * pair[1].angle < 0.0).count();
        assert_eq!(signs, 9, "at 0.07 s, then every 0.14 s, in 1.2 s");
    }

    #[test]
    fn play_is_crossed_in_free_fall() {
        // At rest on one flank; then the torque reverses: ½ (5/2) t² = 0.01, t = 0.089 s.
        let gear = Gear { stiffness: 1e6, play: 0.01, damping_ratio: 0.5 };
        let start = still(gear, &Link { passed: 5.0, inertia: 2.0, slope: 0.0 });
        assert!((start.angle + 0.005).abs() < 1e-4);
        let states = run(gear, start, |_| -5.0, 0.5);
        let crossed = states.iter().position(|state| state.angle > 0.005).unwrap() as f64 * STEP_SECS;
        assert!((crossed - 0.089).abs() < 0.004, "{crossed}");
        assert!((states.last().unwrap().angle - 0.005).abs() < 1e-3);
    }
}
