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
}

macro_rules! effects {
    ($($place:ident $name:literal $summary:literal [$($parameter:literal $unit:literal),*];)*) => {
        /// All effects that can be named.
        pub const EFFECTS: &[Effect] = &[$(Effect {
            name: $name,
            summary: $summary,
            of_joint: effects!(@ $place),
            parameters: &[$(Parameter { name: $parameter, unit: $unit }),*],
        }),*];
    };
    (@ joint) => { true };
    (@ arm) => { false };
}

effects! {
    joint "joint_friction" "Coulomb and viscous friction: F_c sgn(v) + F_v v"
        ["coulomb" "N m", "viscous" "N m s/rad"];
    joint "stribeck_friction" "friction that is higher at low speed: + F_s exp(−|v/v_s|^α) sgn(v)"
        ["coulomb" "N m", "viscous" "N m s/rad", "peak" "N m", "stribeck_rate" "rad/s", "curvature" "1"];
    joint "load_friction" "friction that grows with the torque that the joint passes on: + c |τ| sgn(v)"
        ["coulomb" "N m", "viscous" "N m s/rad", "load" "1"];
    joint "directional_friction" "friction with load that is another one where the load drives the joint than where the motor does"
        ["coulomb" "N m", "viscous" "N m s/rad", "driving" "1", "driven" "1"];
    joint "stribeck_load_friction" "friction with load that is higher at low speed: + c |τ| sgn(v) + (F_s + c_s |τ|) exp(−|v/v_s|^α) sgn(v)"
        ["coulomb" "N m", "viscous" "N m s/rad", "load" "1", "peak" "N m", "load_peak" "1", "stribeck_rate" "rad/s", "curvature" "1"];
    joint "stribeck_directional_friction" "the same, with shares of load that differ by whether load or motor drives the joint"
        ["coulomb" "N m", "viscous" "N m s/rad", "driving" "1", "driven" "1", "peak" "N m", "driving_peak" "1", "driven_peak" "1",
            "stribeck_rate" "rad/s", "curvature" "1"];
    joint "quadratic_load_friction" "the same, with the square of the load at low speed: + d τ² exp(−|v/v_s|^α) sgn(v), by direction"
        ["coulomb" "N m", "viscous" "N m s/rad", "driving" "1", "driven" "1", "peak" "N m", "driving_peak" "1", "driven_peak" "1",
            "driving_square" "1/(N m)", "driven_square" "1/(N m)", "stribeck_rate" "rad/s", "curvature" "1"];
    joint "drifting_friction" "friction that changes with time, as by warmth: F(t) = F (1 + …)"
        ["coulomb" "N m", "viscous" "N m s/rad", "coulomb_change" "N m", "viscous_change" "N m s/rad", "time_constant" "s"];
    joint "presliding" "friction that builds up over a small angle after each reversal (Dahl)"
        ["viscous" "N m s/rad", "coulomb" "N m", "build_up" "rad"];
    joint "reflected_inertia" "inertia of the motor, seen through the gear"
        ["inertia" "kg m2"];
    joint "torque_ripple" "torque that follows the angle: cogging, a gear's teeth"
        ["amplitude" "N m", "phase" "rad", "cycles" "1"];
    joint "torque_gain" "torque that is read, or made, too large by a factor"
        ["gain" "1"];
    joint "torque_offset" "torque that is read with an offset"
        ["offset" "N m"];
    joint "torque_drift" "torque whose reading drifts with time"
        ["offset" "N m", "rate" "N m/s"];
    joint "torque_saturation" "a motor that gives no more than a limit, where more is commanded"
        ["limit" "N m"];
    joint "encoder_offset" "angle that is read with an offset"
        ["offset" "rad"];
    joint "encoder_eccentricity" "angle whose reading errs with the angle itself: a sin(q + φ)"
        ["amplitude" "rad", "phase" "rad"];
    joint "joint_elasticity" "gear that gives under torque, with the angle read on the motor's side"
        ["stiffness" "N m/rad"];
    joint "backlash" "gear with play, with the angle read on the motor's side"
        ["play" "rad"];
    joint "servo_gain" "servo that is stiffer or softer than said"
        ["gain" "1"];
    arm "torque_delay" "torques that are read late against the angles"
        ["delay" "s"];
    arm "command_delay" "commands that act late"
        ["delay" "s"];
    arm "payload" "a body at the tip that the file lacks; of negative mass where the file has too much there"
        ["mass" "kg", "com_x" "m", "com_y" "m", "com_z" "m"];
    arm "base_tilt" "gravity that is not along the base's −z"
        ["slope_x" "rad", "slope_y" "rad"];
    arm "gravity_compensation" "torques from which a share of gravity's has been taken out"
        ["share" "1"];
}

impl Effect {
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
    fn every_effect_stands_in_the_reference_with_its_words() {
        let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/reference/joint-log.md");
        let page = std::fs::read_to_string(page).unwrap();
        for effect in EFFECTS {
            let place = if effect.of_joint { "a joint" } else { "the arm" };
            let row = format!("| `{}` | {place} | {} |", effect.name, effect.summary.replace('|', "\\|"));
            assert!(page.contains(&row), "docs/src/reference/joint-log.md lacks: {row}");
        }
        let rows = page
            .lines()
            .filter(|line| line.starts_with("| `") && (line.contains("| a joint |") || line.contains("| the arm |")));
        assert_eq!(rows.count(), EFFECTS.len());
    }
}
