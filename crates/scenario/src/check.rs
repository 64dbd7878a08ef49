//! What values a scenario may have. The first that is wrong is reported.

use std::fmt::Debug;

use physics_model::EffectKind;

use crate::schema::{LONGEST_PERIOD_SECS, Scenario, SearchSteps, VERSION};

impl Scenario {
    /// What is wrong with the values, if anything: key and expectation.
    pub(crate) fn problem(&self) -> Option<String> {
        (self.identity_problem())
            .or_else(|| self.arm.truth.problem().map(|p| format!("arm.truth.{p}")))
            .or_else(|| self.arm.model.problem().map(|p| format!("arm.model.{p}")))
            .or_else(|| {
                let mut effects = self.effects.truth.iter().chain(&self.effects.model);
                effects.find_map(|effect| effect.problem().map(|p| format!("effects: {p}")))
            })
            .or_else(|| self.world_problem())
            .or_else(|| self.task_problem())
            .or_else(|| self.sensor_problem())
            .or_else(|| self.error_problem())
            .or_else(|| self.distribution_problem())
            .or_else(|| self.run_problem())
    }

    /// Version, names and the arm's numbers.
    fn identity_problem(&self) -> Option<String> {
        // They become names of folders and parts of messages.
        let plain = |text: &str| {
            (1..=64).contains(&text.len())
                && text.starts_with(|c: char| c.is_ascii_alphanumeric())
                && text.chars().all(|c| c.is_ascii_alphanumeric() || ".-_".contains(c))
        };
        let names = [("name", &self.name), ("preset", &self.preset), ("robot.name", &self.robot.name)];
        let expected = "1 to 64 letters, digits, `.`, `_`, `-`, first a letter or digit";
        let urdf = self.robot.urdf.to_string_lossy();
        // The arm checks their ranges. NaN would not even equal itself.
        let r = &self.robot;
        let mut numbers = r.home_rad.iter().chain(r.tool_rotation.iter().flatten()).chain(r.locked_joints.values());
        check(self.version == VERSION, "version", &format!("{VERSION}"), &self.version)
            .or_else(|| names.iter().find_map(|(key, name)| check(plain(name), key, expected, name)))
            .or_else(|| {
                check(!urdf.contains(char::is_control), "robot.urdf", "a path without control characters", &urdf)
            })
            .or_else(|| {
                let found = numbers.find(|v| !v.is_finite())?;
                check(false, "robot", "finite numbers in home_rad, tool_rotation and locked_joints", found)
            })
    }

    fn world_problem(&self) -> Option<String> {
        let w = &self.world;
        let period = w.control_period_secs;
        first([
            (
                positive(period) && period <= LONGEST_PERIOD_SECS,
                "world.control_period_secs",
                "above 0 and at most 0.1 s",
                &period,
            ),
            ((1..=10_000).contains(&w.control_steps), "world.control_steps", "1 to 10000", &w.control_steps),
            ((1..=1000).contains(&w.solver_iterations), "world.solver_iterations", "1 to 1000", &w.solver_iterations),
            (positive(w.contact_frequency_hz), "world.contact_frequency_hz", "above 0 Hz", &w.contact_frequency_hz),
            (positive(w.contact_damping_ratio), "world.contact_damping_ratio", "above 0", &w.contact_damping_ratio),
            (
                up_to(w.arm_stiffness_npm, 1e9),
                "world.arm_stiffness_npm",
                "above 0 and at most 1e9 N/m",
                &w.arm_stiffness_npm,
            ),
            (w.table_height_m.abs() < 10.0, "world.table_height_m", "within 10 m", &w.table_height_m),
            (up_to(w.gravity_mps2, 100.0), "world.gravity_mps2", "above 0 and at most 100 m/s²", &w.gravity_mps2),
            (share(w.tool_friction), "world.tool_friction", "0 to 1", &w.tool_friction),
            (share(w.obstacle_friction), "world.obstacle_friction", "0 to 1", &w.obstacle_friction),
            (share(w.restitution), "world.restitution", "0 to 1", &w.restitution),
        ])
        .or_else(|| {
            let SearchSteps { world_steps, solver_iterations } = self.agent.search_steps?;
            let good = (1..=1000).contains(&solver_iterations);
            first([
                ((1..=100).contains(&world_steps), "agent.search_steps.world_steps", "1 to 100", &world_steps),
                (good, "agent.search_steps.solver_iterations", "1 to 1000", &solver_iterations),
            ])
        })
    }

    fn task_problem(&self) -> Option<String> {
        let t = &self.task;
        let reach = [("task.reach.x_m", t.reach.x_m), ("task.reach.y_m", t.reach.y_m), ("task.reach.z_m", t.reach.z_m)];
        let goal = [t.goal.x_m, t.goal.y_m];
        let rewards =
            [t.reward.step, t.reward.large_force, t.reward.out_of_reach, t.reward.object_moved, t.reward.goal];
        let inside = t.reach.contains(t.tool_start_m);
        first([
            ((1..=10_000).contains(&t.horizon), "task.horizon", "1 to 10000 actions", &t.horizon as &dyn Debug),
            (share(t.discount), "task.discount", "0 to 1", &t.discount),
            ((1e-4..=0.2).contains(&t.step_m), "task.step_m", "0.0001 to 0.2 m", &t.step_m),
        ])
        .or_else(|| reach.iter().find_map(|(key, [a, b])| check(a < b, key, "[low, high] in m", &[a, b])))
        .or_else(|| {
            let moved = t.reward.moved_threshold_m;
            first([
                (inside, "task.tool_start_m", "a point inside task.reach", &t.tool_start_m as &dyn Debug),
                (goal.iter().all(|v| v.abs() <= 10.0), "task.goal", "x_m and y_m within 10 m", &goal),
                (up_to(t.goal.radius_m, 10.0), "task.goal.radius_m", "above 0 and at most 10 m", &t.goal.radius_m),
                (rewards.iter().all(|r| r.abs() <= 1e6), "task.reward", "rewards from -1e6 to 1e6", &rewards),
                (up_to(moved, 10.0), "task.reward.moved_threshold_m", "above 0 and at most 10 m", &moved),
            ])
        })
    }

    fn sensor_problem(&self) -> Option<String> {
        let (s, noise) = (&self.sensor, &self.sensor.noise);
        let stddevs = [
            ("sensor.noise.joint_rad", noise.joint_rad),
            ("sensor.noise.force_n", noise.force_n),
            ("sensor.noise.torque_nm", noise.torque_nm),
            ("sensor.noise.joint_torque_nm", noise.joint_torque_nm),
            ("sensor.noise.position_m", noise.position_m),
            ("sensor.noise.orientation_rad", noise.orientation_rad),
        ];
        let limit = s.large_force_limit;
        let expected = "a standard deviation above 0 and at most 1000";
        check(up_to(limit, 1e6), "sensor.large_force_limit", "above 0 and at most 1e6", &limit)
            .or_else(|| stddevs.iter().find_map(|(key, v)| check(up_to(*v, 1000.0), key, expected, v)))
    }

    /// What particles are shaken by, and what the model is off by.
    fn error_problem(&self) -> Option<String> {
        let (p, m) = (&self.perturb, &self.transition_noise);
        let stddevs = [
            ("perturb.position_m", p.position_m),
            ("perturb.yaw_rad", p.yaw_rad),
            ("perturb.linear_mps", p.linear_mps),
            ("perturb.angular_rps", p.angular_rps),
            ("perturb.mass_share", p.mass_share),
            ("perturb.com_m", p.com_m),
            ("perturb.friction", p.friction),
            ("perturb.size_m", p.size_m),
            ("transition_noise.position_m", m.position_m),
            ("transition_noise.yaw_rad", m.yaw_rad),
            ("transition_noise.force_share", m.force_share),
            ("transition_noise.joint_torque_nm", m.joint_torque_nm),
        ];
        let at_least_0 = |v: f64| v.is_finite() && v >= 0.0;
        stddevs.iter().find_map(|(key, v)| check(at_least_0(*v), key, "a standard deviation, at least 0", v))
    }

    fn distribution_problem(&self) -> Option<String> {
        let problem = self.distribution.problem().map(|p| format!("distribution.{p}"));
        problem.or_else(|| {
            let effects = || self.effects.truth.iter().chain(&self.effects.model);
            let unlisted = |kind: &&EffectKind| !effects().any(|effect| effect.kind() == **kind);
            let name = self.distribution.effects.keys().find(unlisted)?.name();
            Some(format!("distribution.effects.{name}: expected {name} in effects.truth or effects.model"))
        })
    }

    /// What runs are told.
    fn run_problem(&self) -> Option<String> {
        let (d, trials) = (&self.data, &self.evaluation.trials);
        let actions = (1..=10_000).contains(&d.episode_actions);
        first([
            (share(d.movable_share), "data.movable_share", "0 to 1", &d.movable_share as &dyn Debug),
            (share(d.goal_share), "data.goal_share", "0 to 1", &d.goal_share),
            (share(d.exploration_share), "data.exploration_share", "0 to 1", &d.exploration_share),
            (actions, "data.episode_actions", "1 to 10000", &d.episode_actions),
            ((1..=1_000_000).contains(trials), "evaluation.trials", "1 to 1000000", trials),
        ])
    }
}

/// A requirement: whether it is met, key, expectation and what was found.
type Requirement<'a> = (bool, &'a str, &'a str, &'a dyn Debug);

/// The first that is not met.
fn first<const N: usize>(requirements: [Requirement<'_>; N]) -> Option<String> {
    requirements.into_iter().find_map(|(good, key, expectation, found)| check(good, key, expectation, found))
}

fn check(good: bool, key: &str, expectation: &str, found: &dyn Debug) -> Option<String> {
    (!good).then(|| format!("{key}: expected {expectation}, found {found:?}"))
}

/// Above 0, and no larger than anybody means: a world with other numbers is not simulated, but lost.
fn up_to(value: f64, most: f64) -> bool {
    value > 0.0 && value <= most
}

fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

fn share(value: f64) -> bool {
    (0.0..=1.0).contains(&value)
}
