//! The catalogue: what a joint or an arm may do that the nominal model lacks.

use serde::Serialize;

/// A parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Parameter {
    /// As in reports.
    pub name: &'static str,
    /// SI.
    pub unit: &'static str,
}

/// What is known of an effect before any log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Effect {
    /// As in reports.
    pub name: &'static str,
    /// What it is.
    pub summary: &'static str,
    /// Whether it is of one joint, rather than of the whole arm.
    pub of_joint: bool,
    /// What it is made of.
    pub parameters: &'static [Parameter],
    /// Motion that shows it.
    pub shows: &'static str,
    /// Effects that leave similar traces, with what to do to tell the two apart.
    pub look_alikes: &'static [(&'static str, &'static str)],
}

macro_rules! effects {
    ($($place:ident $name:literal $summary:literal [$($parameter:literal $unit:literal),*]
        shows $shows:literal like [$($other:literal: $tell:literal),*];)*) => {
        /// All effects that can be named.
        pub const EFFECTS: &[Effect] = &[$(Effect {
            name: $name,
            summary: $summary,
            of_joint: effects!(@ $place),
            parameters: &[$(Parameter { name: $parameter, unit: $unit }),*],
            shows: $shows,
            look_alikes: &[$(($other, $tell)),*],
        }),*];
    };
    (@ joint) => { true };
    (@ arm) => { false };
}

effects! {
    joint "joint_friction" "Coulomb and viscous friction: F_c sgn(v) + F_v v"
        ["coulomb" "N m", "viscous" "N m s/rad"]
        shows "Motion both ways through the same angles, at two speeds or more"
        like ["torque_offset": "reverse: friction changes its sign, an offset does not",
            "command_delay": "compare joints: a delay is the same in all, friction is not",
            "stribeck_friction": "add speeds below 0.1 rad/s",
            "load_friction": "repeat the same motion with another load",
            "drifting_friction": "record for longer, from a cold start"];
    joint "stribeck_friction" "friction that is higher at low speed: + F_s exp(−|v/v_s|^α) sgn(v)"
        ["coulomb" "N m", "viscous" "N m s/rad", "peak" "N m", "stribeck_rate" "rad/s", "curvature" "1"]
        shows "Slow motion both ways, below 0.3 rad/s, beside faster motion"
        like ["presliding": "reverse within a few mrad: presliding follows the angle, the Stribeck effect the speed",
            "joint_friction": "add speeds below 0.1 rad/s",
            "stribeck_load_friction": "repeat the slow motion with another load"];
    joint "load_friction" "friction that grows with the torque that the joint passes on: + c |τ| sgn(v)"
        ["coulomb" "N m", "viscous" "N m s/rad", "load" "1"]
        shows "The same motion with little and with much load: the arm folded and stretched, with and without a payload"
        like ["torque_gain": "reverse: friction changes its sign, a gain's error follows the load",
            "joint_friction": "repeat the same motion with another load",
            "directional_friction": "lift and lower the same load",
            "stribeck_load_friction": "add speeds below 0.1 rad/s"];
    joint "directional_friction" "friction with load that is another one where the load drives the joint than where the motor does"
        ["coulomb" "N m", "viscous" "N m s/rad", "driving" "1", "driven" "1"]
        shows "Lifting and lowering the same load, at the same speeds"
        like ["torque_gain": "give torque constants to 2 % or better: the difference of lifting and lowering is a share of the torque, as a gain's error is",
            "load_friction": "lift and lower the same load"];
    joint "stribeck_load_friction" "friction with load that is higher at low speed: + c |τ| sgn(v) + (F_s + c_s |τ|) exp(−|v/v_s|^α) sgn(v)"
        ["coulomb" "N m", "viscous" "N m s/rad", "load" "1", "peak" "N m", "load_peak" "1", "stribeck_rate" "rad/s", "curvature" "1"]
        shows "Slow and fast motion with several loads"
        like ["stribeck_friction": "repeat the slow motion with another load",
            "load_friction": "add speeds below 0.1 rad/s",
            "stribeck_directional_friction": "lift and lower the same loads slowly"];
    joint "stribeck_directional_friction" "friction with load that is higher at low speed, with shares of load that differ by whether load or motor drives the joint"
        ["coulomb" "N m", "viscous" "N m s/rad", "driving" "1", "driven" "1", "peak" "N m", "driving_peak" "1", "driven_peak" "1",
            "stribeck_rate" "rad/s", "curvature" "1"]
        shows "Lifting and lowering several loads, slowly and fast"
        like ["stribeck_load_friction": "lift and lower the same loads slowly",
            "quadratic_load_friction": "lift and lower three loads or more slowly"];
    joint "quadratic_load_friction" "friction with load and its square at low speed, + d τ² exp(−|v/v_s|^α) sgn(v), by whether load or motor drives the joint"
        ["coulomb" "N m", "viscous" "N m s/rad", "driving" "1", "driven" "1", "peak" "N m", "driving_peak" "1", "driven_peak" "1",
            "driving_square" "1/(N m)", "driven_square" "1/(N m)", "stribeck_rate" "rad/s", "curvature" "1"]
        shows "Lifting and lowering three loads or more, slowly and fast"
        like ["stribeck_directional_friction": "lift and lower three loads or more slowly"];
    joint "drifting_friction" "friction that changes with time, as by warmth: F + ΔF (1 − exp(−t/T)) / (1 − exp(−L/T)) in a log of length L"
        ["coulomb" "N m", "viscous" "N m s/rad", "coulomb_change" "N m", "viscous_change" "N m s/rad", "time_constant" "s"]
        shows "The same motion from a cold start on, over minutes"
        like ["torque_drift": "reverse: friction changes its sign, a drifting reading does not",
            "joint_friction": "record for longer, from a cold start"];
    joint "presliding" "friction that builds up over a small angle after each reversal (Dahl)"
        ["viscous" "N m s/rad", "coulomb" "N m", "build_up" "rad"]
        shows "Reversals, and motion back and forth over less than 20 mrad"
        like ["joint_elasticity": "load a joint that stands: with presliding the motor turns a little, and an elastic gear gives where the motor does not see it",
            "backlash": "reverse under a load of one sign: play stays closed, presliding shows",
            "stribeck_friction": "reverse within a few mrad: presliding follows the angle, the Stribeck effect the speed"];
    joint "reflected_inertia" "inertia of the motor, seen through the gear"
        ["inertia" "kg m2"]
        shows "Strong accelerations"
        like ["payload": "hold still in several poses: a payload has a weight"];
    joint "torque_ripple" "torque that follows the angle: cogging, a gear's teeth"
        ["amplitude" "N m", "phase" "rad", "cycles" "1"]
        shows "Slow motion through half a turn or more"
        like ["encoder_eccentricity": "repeat the motion with another load: an angle's error grows with the load, ripple does not"];
    joint "torque_gain" "torque that is read, or made, too large by a factor"
        ["gain" "1"]
        shows "Large torques that are known well, such as those of gravity on a stretched arm"
        like ["payload": "compare joints: a payload shows in all joints before it, a gain in one",
            "load_friction": "reverse: friction changes its sign, a gain's error follows the load",
            "gravity_compensation": "accelerate strongly: a gain scales those torques too",
            "directional_friction": "give torque constants to 2 % or better: the difference of lifting and lowering is a share of the torque, as a gain's error is"];
    joint "torque_offset" "torque that is read with an offset"
        ["offset" "N m"]
        shows "Motion both ways through poses of different load"
        like ["encoder_offset": "turn the joint far: the error of a wrong angle changes with the pose",
            "torque_drift": "repeat the same poses at the end of the log",
            "joint_friction": "reverse: friction changes its sign, an offset does not"];
    joint "torque_drift" "torque whose reading drifts with time"
        ["offset" "N m", "rate" "N m/s"]
        shows "The same poses at the beginning and at the end of a log of minutes"
        like ["torque_offset": "repeat the same poses at the end of the log",
            "drifting_friction": "reverse: friction changes its sign, a drifting reading does not"];
    joint "torque_saturation" "a motor that gives no more than a limit, where more is commanded"
        ["limit" "N m"]
        shows "Commands that ask for more than the motor gives"
        like ["servo_gain": "add motion with small errors of position: a limit does not show there"];
    joint "encoder_offset" "angle that is read with an offset"
        ["offset" "rad"]
        shows "Poses that differ in this joint, with a load on it"
        like ["base_tilt": "turn the first joint: what a tilt does depends on its angle, what a wrong angle of another joint does, does not",
            "torque_offset": "turn the joint far: the error of a wrong angle changes with the pose"];
    joint "encoder_eccentricity" "angle whose reading errs with the angle itself: a sin(q + φ)"
        ["amplitude" "rad", "phase" "rad"]
        shows "Slow motion through a whole turn or most of one, with a load"
        like ["torque_ripple": "repeat the motion with another load: an angle's error grows with the load, ripple does not"];
    joint "joint_elasticity" "gear that gives under torque, with the angle read on the motor's side"
        ["stiffness" "N m/rad"]
        shows "Quick changes of the load, angles read at the motor"
        like ["backlash": "keep the load on one side: play then stays closed, an elastic gear still gives",
            "presliding": "load a joint that stands: with presliding the motor turns a little, and an elastic gear gives where the motor does not see it",
            "torque_delay": "compare joints: a delay is the same in all, an elastic gear is not"];
    joint "backlash" "gear with play, with the angle read on the motor's side"
        ["play" "rad", "stiffness" "N m/rad"]
        shows "A load that changes its sign, angles read at the motor"
        like ["joint_elasticity": "keep the load on one side: play then stays closed, an elastic gear still gives",
            "presliding": "reverse under a load of one sign: play stays closed, presliding shows"];
    joint "servo_gain" "servo that is stiffer or softer than said"
        ["gain" "1"]
        shows "Errors of position under several known loads"
        like ["payload": "compare joints: a payload shows in all joints before it, a gain in one",
            "torque_saturation": "add motion with small errors of position: a limit does not show there"];
    arm "torque_delay" "torques that are read late against the angles"
        ["delay" "s"]
        shows "Torques that change quickly, as in an excitation of many frequencies"
        like ["joint_elasticity": "compare joints: a delay is the same in all, an elastic gear is not"];
    arm "command_delay" "commands that act late"
        ["delay" "s"]
        shows "Commands that change quickly"
        like ["joint_friction": "compare joints: a delay is the same in all, friction is not"];
    arm "payload" "a body at the tip that the file lacks; of negative mass where the file has too much there"
        ["mass" "kg", "com_x" "m", "com_y" "m", "com_z" "m"]
        shows "Poses with the tip at several distances from each joint, held still and accelerated"
        like ["torque_gain": "compare joints: a payload shows in all joints before it, a gain in one",
            "base_tilt": "turn the first joint: what a tilt does depends on its angle",
            "reflected_inertia": "hold still in several poses: a payload has a weight",
            "servo_gain": "compare joints: a payload shows in all joints before it, a gain in one"];
    arm "base_tilt" "gravity that is not along the base's −z"
        ["slope_x" "rad", "slope_y" "rad"]
        shows "Poses that differ in the first joint, with the arm stretched"
        like ["encoder_offset": "turn the first joint: what a tilt does depends on its angle, what a wrong angle of another joint does, does not",
            "payload": "turn the first joint: what a tilt does depends on its angle"];
    arm "gravity_compensation" "torques from which a share of gravity's has been taken out"
        ["share" "1"]
        shows "Poses with much and with little of gravity's torque, and strong accelerations"
        like ["torque_gain": "accelerate strongly: a gain scales those torques too"];
}

impl Effect {
    /// Where a value is expected before the log is seen: the spread of its prior, or the settings that are tried.
    #[must_use]
    pub fn plausible(&self, parameter: &Parameter) -> &'static str {
        match (self.name, parameter.name) {
            ("torque_ripple", "amplitude") => "up to about 10 % of the usual torque",
            ("encoder_eccentricity", "amplitude") => "up to about 0.03",
            ("torque_offset" | "torque_drift", "offset") => "within about 20 % of the usual torque",
            ("encoder_offset", "offset") => "within about 0.05",
            ("torque_delay", _) => "within about 0.02",
            ("command_delay", _) => "0.006 to 0.072",
            (_, "coulomb" | "peak") => "up to about 30 % of the usual torque",
            (_, "viscous") => "up to about 30 % of the usual torque, at the usual speed",
            (_, "coulomb_change") => "within about 30 % of the usual torque",
            (_, "viscous_change") => "within about 30 % of the usual torque, at the usual speed",
            (_, "stribeck_rate") => "0.01 to 0.32",
            (_, "curvature") => "1.25 or 2",
            (_, "load" | "driving" | "driven" | "load_peak" | "driving_peak" | "driven_peak") => "up to about 0.2",
            (_, "driving_square" | "driven_square") => "up to about 0.2 over the usual torque",
            (_, "time_constant") => "0.15 to 4 times the log's length",
            (_, "build_up") => "0.0005 to 0.02",
            (_, "inertia") => "up to about the joint's own",
            (_, "phase") => "−π to π",
            (_, "cycles") => "1 to 120 a turn",
            ("servo_gain", "gain") => "about 0.7 to 1.7",
            (_, "gain") => "within about 0.4 of 1",
            (_, "rate") => "within about 20 % of the usual torque, over the log",
            (_, "limit") => "what 3 to 50 % of the commanded torques exceed",
            ("backlash", "stiffness") => "turns by up to about 0.005 rad under the usual torque",
            (_, "stiffness") => "turns by up to about 0.1 rad under the usual torque",
            (_, "play") => "up to about 0.05",
            (_, "mass") => "up to the arm's own, either way",
            (_, "com_x" | "com_y" | "com_z") => "within about 0.15",
            (_, "slope_x" | "slope_y") => "within about 0.05",
            (_, "share") => "up to about 0.7",
            _ => "",
        }
    }

    /// The effect of that name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        EFFECTS.iter().find(|effect| effect.name == name)
    }

    /// Whether it holds Coulomb and viscous friction and more.
    #[must_use]
    pub fn extends_friction(&self) -> bool {
        self.is_compound_friction()
            || ["stribeck_friction", "load_friction", "directional_friction", "drifting_friction", "presliding"]
                .contains(&self.name)
    }

    /// Whether it is friction that has the Stribeck effect and load at once.
    #[must_use]
    pub fn is_compound_friction(&self) -> bool {
        ["stribeck_load_friction", "stribeck_directional_friction", "quadratic_load_friction"].contains(&self.name)
    }
}

impl PartialOrd for Effect {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Effect {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let place = |effect: &Self| EFFECTS.iter().position(|found| found.name == effect.name);
        place(self).cmp(&place(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_says_what_is_plausible_what_shows_it_and_what_it_is_confused_with() {
        for effect in EFFECTS {
            for parameter in effect.parameters {
                assert!(!effect.plausible(parameter).is_empty(), "{}: {}", effect.name, parameter.name);
            }
            assert!(!effect.shows.is_empty() && !effect.look_alikes.is_empty(), "{}", effect.name);
            for (other, tell) in effect.look_alikes {
                assert!(Effect::find(other).is_some() && *other != effect.name, "{}: {other}", effect.name);
                assert!(!tell.is_empty(), "{}: {other}", effect.name);
                let back = Effect::find(other).unwrap().look_alikes;
                assert!(back.contains(&(effect.name, tell)), "{other} does not say so of {}", effect.name);
            }
        }
    }
}
