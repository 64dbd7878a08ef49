//! Pictures of effects: the same push with and without.

use std::sync::Arc;

use anyhow::Result;
use figures::{Axis, Chart, Draw, Figure, Lines, Map, Outline, Panel, Series};
use physics_model::effect::EffectConfig;
use physics_model::robot::Robot;
use physics_model::{BodyState, EffectKind, RigReading};

use crate::scene::{BALL_M, BOX_M, PLACE_M, Run, STANDARD, Scene, TICK_SECS};

const WITHOUT: &str = "without";
const WITH: &str = "with";
/// Points of a line, at most: more are not to be told apart.
const POINTS: usize = 240;
/// A force above it is the knock at contact onset, which would hide all others, N.
const KNOCK_N: f64 = 6.0;
/// Forces that are drawn then, N.
const FORCES_N: (f64, f64) = (-0.5, 4.0);

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
enum View {
    /// Force that the sensor reads, against the push.
    Force,
    /// Vertical force that the sensor reads.
    VerticalForce,
    /// Way of the object as it is read.
    Way,
    /// Height of the object as it is read.
    Height,
    /// Yaw of the object as it is read.
    Yaw,
    /// Way of the tool.
    Tool,
    /// How far the tool is behind its command.
    ToolLag,
    /// Torque of a joint.
    Torque(usize),
    /// How far a joint is from where it is without the effect.
    Joint(usize),
    /// Path of the object as it is read, from above.
    Above,
}

/// How an effect is shown.
struct Setup {
    values: &'static [f64],
    scene: Scene,
    view: View,
}

/// A picture and what it shows.
pub(crate) struct Picture {
    pub(crate) svg: String,
    pub(crate) caption: String,
}

const fn setup(values: &'static [f64], scene: Scene, view: View) -> Setup {
    Setup { values, scene, view }
}

const SLOW: Scene = Scene::Push { speed_mps: 0.03, aside_m: 0.0 };
const ASIDE: Scene = Scene::Push { speed_mps: 0.3, aside_m: 0.012 };

/// Values within what is plausible, and what shows them best.
fn setup_of(kind: EffectKind) -> Setup {
    use EffectKind as K;
    use View as V;
    match kind {
        K::ViscousDamping => setup(&[2.0], STANDARD, V::Force),
        K::QuadraticDrag => setup(&[4.0], STANDARD, V::Force),
        K::FrictionLevel => setup(&[0.45], STANDARD, V::Force),
        K::StribeckFriction => setup(&[0.8, 0.05], SLOW, V::Force),
        K::StaticFriction => setup(&[1.6], Scene::Creep, V::Force),
        K::AnisotropicFriction => setup(&[0.3, 0.0], STANDARD, V::Force),
        K::FrictionPatch => setup(&[1.0, PLACE_M[0] + 0.08, 0.0, 0.04], STANDARD, V::Force),
        K::PressureDistribution => setup(&[0.2], ASIDE, V::Yaw),
        K::RollingResistance => setup(&[0.005], Scene::Roll, V::Way),
        K::TableTilt => setup(&[0.0, 0.0524], STANDARD, V::Above),
        K::ConstantForce => setup(&[0.0, 0.5], STANDARD, V::Above),
        K::Tether => setup(&[10.0, PLACE_M[0], 0.0], STANDARD, V::Force),
        K::ComOffset => setup(&[0.0, 0.25, 0.0], STANDARD, V::Above),
        K::EdgeRounding => setup(&[0.02], Scene::Drop, V::Height),
        K::MassLeak => setup(&[0.02], SLOW, V::Force),
        K::Restitution => setup(&[0.6], Scene::Drop, V::Height),
        K::ContactCompliance => setup(&[20.0, 0.5], STANDARD, V::Height),
        K::ArmCompliance => setup(&[500.0], STANDARD, V::ToolLag),
        K::ActuatorGain => setup(&[1.2], STANDARD, V::Tool),
        K::Backlash => setup(&[0.003], Scene::Arm, V::Joint(1)),
        K::ActuationDelay => setup(&[0.1], STANDARD, V::Tool),
        K::JointFriction => setup(&[0.09, 0.5], Scene::Arm, V::Torque(1)),
        K::WristPayload => setup(&[0.3, 0.0, 0.0, 0.0], STANDARD, V::VerticalForce),
        K::ForceBias => setup(&[-1.0, 0.0, 0.0], STANDARD, V::Force),
        K::ForceDrift => setup(&[-0.0017, 0.0, 0.0], Scene::Rest, V::Force),
        K::ForceGain => setup(&[1.25], STANDARD, V::Force),
        K::ForceLowPass => setup(&[0.08], STANDARD, V::Force),
        K::ForceDelay => setup(&[0.1], STANDARD, V::Force),
        K::ForceSaturation => setup(&[1.0], STANDARD, V::Force),
        K::PoseOffset => setup(&[0.0, 0.02, 0.0], STANDARD, V::Above),
        K::PoseDelay => setup(&[0.1], STANDARD, V::Way),
        K::PoseScale => setup(&[1.06], STANDARD, V::Above),
        K::TimeBase => setup(&[1.06], Scene::Drop, V::Height),
        K::PoseRotation => setup(&[0.0873], STANDARD, V::Above),
        K::HiddenObstacle => setup(&[PLACE_M[0] + 0.13, 0.045, 0.4, 0.04, 0.04, 0.04, 1.0], STANDARD, V::Above),
        K::Adhesion => setup(&[3.0], SLOW, V::Force),
    }
}

/// What an effect does to the push.
pub(crate) fn picture(kind: EffectKind, robot: &Arc<Robot>) -> Result<Picture> {
    let Setup { values, scene, view } = setup_of(kind);
    let effect = kind.from_parameters(values)?;
    let without = scene.play(robot, &[])?;
    let with = scene.play(robot, &[effect.build()])?;
    let chart = match view {
        View::Above => above(&effect, &without, &with),
        _ => {
            let mut series = vec![line(WITHOUT, view, &without, &without), line(WITH, view, &with, &without)];
            if kind == EffectKind::AnisotropicFriction {
                // The same grain, turned: as if the push went across it.
                let across = kind.from_parameters(&[values[0], std::f64::consts::FRAC_PI_2])?;
                let across = scene.play(robot, &[across.build()])?;
                series[1].name = "with, along the axis".into();
                series.push(line("with, across the axis", view, &across, &without));
            }
            let peak = series.iter().flat_map(|line| &line.points).map(|(_, y)| *y).fold(0.0, f64::max);
            let limits = (view == View::Force && peak > KNOCK_N).then_some(FORCES_N);
            let y = Axis { limits, ..Axis::new(label(view)) };
            Chart::Lines(Lines { x: Axis::new("time / s"), y, series, references: vec![] })
        }
    };
    let figure = Figure {
        title: String::new(),
        panels: vec![Panel { title: String::new(), chart }],
        columns: 1,
        panel_size_px: (560, 250),
        colors: vec![WITHOUT.into(), WITH.into()],
    };
    Ok(Picture { svg: figure.svg()?, caption: caption(&effect, scene, view) })
}

const fn label(view: View) -> &'static str {
    match view {
        View::Force => "force / N",
        View::VerticalForce => "vertical force / N",
        View::Way => "way of the object / cm",
        View::Height => "height of the object / cm",
        View::Yaw => "yaw of the object / °",
        View::Tool => "way of the tool / cm",
        View::ToolLag => "tool behind its command / mm",
        View::Torque(_) => "torque of the joint / N·m",
        View::Joint(_) => "change of the joint / mrad",
        View::Above => "",
    }
}

fn line(name: &str, view: View, run: &Run, without: &Run) -> Series {
    let value = |tick: usize| -> f64 {
        let reading = &run.readings[tick];
        let tool_m = reading.tool_m.unwrap_or_default();
        match view {
            View::Force => -reading.wrench.force_n[0],
            View::VerticalForce => reading.wrench.force_n[2],
            View::Way => 100.0 * (reading.object.position_m[0] - PLACE_M[0]),
            View::Height => 100.0 * reading.object.position_m[2],
            View::Yaw | View::Above => yaw(&reading.object).to_degrees(),
            View::Tool => 100.0 * (tool_m[0] - run.commands_m[0][0]),
            View::ToolLag => 1000.0 * (run.commands_m[tick][0] - tool_m[0]),
            View::Torque(joint) => reading.joint_torque_nm[joint],
            View::Joint(joint) => 1000.0 * (reading.joints_rad[joint] - without.readings[tick].joints_rad[joint]),
        }
    };
    let stride = run.readings.len().div_ceil(POINTS).max(1);
    let points = (0..run.readings.len()).step_by(stride).map(|tick| (TICK_SECS * (tick + 1) as f64, value(tick)));
    Series { name: name.into(), points: points.collect(), ..Series::default() }
}

fn yaw(body: &BodyState) -> f64 {
    let [x, y, z, w] = body.orientation;
    (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
}

fn above(effect: &EffectConfig, without: &Run, with: &Run) -> Chart {
    let closed = |points: Vec<(f64, f64)>| {
        points.first().copied().into_iter().fold(points, |mut all, first| {
            all.push(first);
            all
        })
    };
    let corners = |body: &BodyState| {
        let (sin, cos) = yaw(body).sin_cos();
        let half = [0.5 * BOX_M[0], 0.5 * BOX_M[1]];
        let corner = |a: f64, b: f64| {
            let (x, y) = (a * half[0], b * half[1]);
            (body.position_m[0] + x * cos - y * sin, body.position_m[1] + x * sin + y * cos)
        };
        closed(vec![corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)])
    };
    let outline = |name: &str, like: &str, points: Vec<(f64, f64)>, draw: Draw| Outline {
        name: name.into(),
        like: like.into(),
        points,
        draw,
    };
    let circle = |at: (f64, f64), radius: f64| {
        let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / 32.0;
        (0..=32).map(|i| (at.0 + radius * angle(i).cos(), at.1 + radius * angle(i).sin())).collect::<Vec<_>>()
    };
    let mut shapes = Vec::new();
    let tool = with.commands_m.iter().map(|c| (c[0], c[1])).collect::<Vec<_>>();
    let farthest = tool.iter().copied().fold(tool[0], |far, at| if at.0 > far.0 { at } else { far });
    shapes.push(outline("tool", "", circle(farthest, BALL_M), Draw::Area { opacity: 0.5 }));
    if let EffectConfig::HiddenObstacle(hidden) = effect {
        let body = BodyState::at_rest([hidden.x_m, hidden.y_m, 0.0], hidden.yaw_rad);
        let (sin, cos) = yaw(&body).sin_cos();
        let corner = |a: f64, b: f64| {
            let (x, y) = (0.5 * a * hidden.size_m[0], 0.5 * b * hidden.size_m[1]);
            (hidden.x_m + x * cos - y * sin, hidden.y_m + x * sin + y * cos)
        };
        let points = closed(vec![corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)]);
        shapes.push(outline("hidden body", "", points, Draw::Area { opacity: 0.5 }));
    }
    for (name, run) in [(WITHOUT, without), (WITH, with)] {
        let path = |readings: &[RigReading]| {
            readings.iter().map(|r| (r.object.position_m[0], r.object.position_m[1])).collect()
        };
        shapes.push(outline("", name, corners(&run.readings[0].object), Draw::Dashed));
        shapes.push(outline("", name, path(&run.readings), Draw::Line));
        if let Some(last) = run.readings.last() {
            shapes.push(outline(name, "", corners(&last.object), Draw::Line));
        }
    }
    let limits = Some(((PLACE_M[0] - 0.06, PLACE_M[0] + 0.24), (-0.1, 0.1)));
    Chart::Map(Map { limits, shapes, scale_bar: Some((0.05, "5 cm".into())) })
}

fn caption(effect: &EffectConfig, scene: Scene, view: View) -> String {
    let kind = effect.kind();
    let values = kind.parameters().iter().zip(effect.values());
    let values = values
        .map(|(parameter, value)| format!("`{}` = {value} {}", parameter.name, parameter.unit).trim_end().to_owned());
    let what = match scene {
        Scene::Push { speed_mps, .. } if speed_mps < 0.1 => "the push at 0.03 m/s",
        Scene::Push { aside_m, .. } if aside_m != 0.0 => "the push, 12 mm beside the middle",
        Scene::Push { .. } => "the push",
        Scene::Roll => "the push of a sphere",
        Scene::Creep => "a creep at 0.3 mm/s, then a walk at 2 cm/s",
        Scene::Rest => "a minute in which the tool stands still",
        Scene::Drop => "a fall on an edge, turned by 30°, without a tool",
        Scene::Arm => "the push by the arm Sawyer",
    };
    let shown = match view {
        View::Above => "path from above; dashed: the start".to_owned(),
        View::Torque(joint) | View::Joint(joint) => format!("{}, joint {}", label(view), joint + 1),
        _ => label(view).to_owned(),
    };
    format!("{what}, {}. Shown: {shown}.", values.collect::<Vec<_>>().join(", "))
}
