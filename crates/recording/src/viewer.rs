//! A trace as a recording for the Rerun viewer: the arm, the tool, what is true and what is believed in space; probabilities, parameters and
//! the tree over the actions.

use rerun::blueprint::{BarChartView, Spatial3DView, TimeSeriesView};
use rerun::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Tabs, TimePanel, Vertical,
};
use rerun::external::re_sdk_types::blueprint::components::PanelState;
use rerun::{
    BarChart, Boxes3D, Color, Cylinders3D, Ellipsoids3D, FillMode, LineStrips3D, Points3D, Quaternion, RecordingStream,
    RecordingStreamBuilder, Scalars, SeriesLines, TextLog, Transform3D,
};

use crate::{Body, BodyShape, EpisodeTrace, Error, Moment, SeenBelief, SeenSearch};

/// Name that the viewer keeps its layout under.
const APPLICATION: &str = "surmise";
/// What happens is counted in actions.
const TIMELINE: &str = "action";

// Okabe and Ito's colours, as in the pictures.
// The viewer is dark.
const TRUTH: [u8; 3] = [0xe0, 0xe0, 0xe0];
const OBJECT: [u8; 3] = [0x00, 0x72, 0xb2];
const OBSTACLE: [u8; 3] = [0xd5, 0x5e, 0x00];
const GOAL: [u8; 3] = [0x00, 0x9e, 0x73];
const ARM: [u8; 3] = [0xe6, 0x9f, 0x00];
/// Opacity of one of a hundred particles.
const GHOST: u8 = 12;

/// The recording, to be written to a file that ends in `.rrd`.
///
/// # Errors
///
/// Where the library refuses.
pub fn recording(trace: &EpisodeTrace) -> Result<Vec<u8>, Error> {
    let identity = format!("{} {}", trace.commit, trace.title);
    let builder = RecordingStreamBuilder::new(APPLICATION).recording_id(identity).with_blueprint(layout());
    let (stream, storage) = builder.memory()?;
    scenery(&stream, trace)?;
    for (index, moment) in trace.moments.iter().enumerate() {
        stream.set_time_sequence(TIMELINE, index as i64);
        arm(&stream, trace, moment)?;
        if let Some(truth) = &moment.truth {
            bodies(&stream, "world/true/object", &[truth.object], TRUTH, 255)?;
            let obstacle: Vec<Body> = truth.obstacle.into_iter().collect();
            bodies(&stream, "world/true/obstacle", &obstacle, TRUTH, 160)?;
        }
        if let Some(belief) = &moment.belief {
            particles(&stream, belief)?;
        }
        if let Some(search) = &moment.search {
            tree(&stream, search)?;
        }
        for event in &moment.events {
            stream.log("events", &TextLog::new(event.as_str()))?;
        }
    }
    stream.flush_blocking().map_err(|e| Error::Encode { message: e.to_string() })?;
    storage.drain_as_bytes().map_err(|e| Error::Encode { message: e.to_string() })
}

/// Space on the left, numbers on the right, the viewer's own panels closed.
fn layout() -> Blueprint {
    let space: ContainerLike = Spatial3DView::new("episode").with_origin("world").into();
    let shapes = TimeSeriesView::new("shape and obstacle").with_origin("belief");
    let numbers: [ContainerLike; 3] = [
        TimeSeriesView::new("friction").with_origin("theta/friction").into(),
        TimeSeriesView::new("mass / kg").with_origin("theta/mass").into(),
        TimeSeriesView::new("height / m").with_origin("theta/height").into(),
    ];
    let tree: [ContainerLike; 2] = [
        BarChartView::new("visits of the root's actions").with_origin("tree/visits").into(),
        TimeSeriesView::new("nodes and simulations").with_origin("tree/size").into(),
    ];
    let right = Vertical::new([shapes.into(), Tabs::new(numbers).into(), Tabs::new(tree).into()]);
    Blueprint::new(Horizontal::new([space, right.into()]).with_column_shares(vec![3.0, 2.0]))
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(TimePanel::new().with_state(PanelState::Collapsed).with_timeline(TIMELINE))
}

/// What does not change: the goal, and how the lines of the charts look.
fn scenery(stream: &RecordingStream, trace: &EpisodeTrace) -> Result<(), Error> {
    let [x, y] = trace.goal.center_m;
    let circle = (0..=48).map(|i| {
        let angle = std::f64::consts::TAU * f64::from(i) / 48.0;
        let (dx, dy) = (trace.goal.radius_m * angle.cos(), trace.goal.radius_m * angle.sin());
        single([x + dx, y + dy, trace.table_height_m])
    });
    let goal = LineStrips3D::new([circle.collect::<Vec<_>>()]).with_colors([color(GOAL, 255)]).with_radii([0.002]);
    stream.log_static("world/goal", &goal)?;
    let line = |path: String, rgb: [u8; 3], name: &str| -> Result<(), Error> {
        let look = SeriesLines::new().with_colors([color(rgb, 255)]).with_names([name]);
        Ok(stream.log_static(path, &look)?)
    };
    for (shape, rgb) in BodyShape::ALL.into_iter().zip([OBJECT, [0x56, 0xb4, 0xe9], [0xcc, 0x79, 0xa7]]) {
        line(format!("belief/{}", shape.name()), rgb, shape.name())?;
    }
    line("belief/obstacle".into(), OBSTACLE, "obstacle")?;
    for parameter in trace.moments.iter().filter_map(|m| m.belief.as_ref()).take(1).flat_map(|b| &b.parameters) {
        let path = path_of(&parameter.name);
        for (end, rgb) in [("low", GOAL), ("median", OBJECT), ("high", GOAL), ("true", TRUTH)] {
            let name = match end {
                "low" => "5 %",
                "high" => "95 %",
                other => other,
            };
            line(format!("{path}/{end}"), rgb, name)?;
        }
    }
    Ok(())
}

fn arm(stream: &RecordingStream, trace: &EpisodeTrace, moment: &Moment) -> Result<(), Error> {
    let joints = moment.joints.iter().map(|pose| pose.position_m).chain([moment.tool.position_m]);
    let places: Vec<[f32; 3]> = std::iter::once([0.0; 3]).chain(joints.map(single)).collect();
    let links = LineStrips3D::new([places.clone()]).with_colors([color(ARM, 255)]).with_radii([0.012]);
    stream.log("world/arm/links", &links)?;
    stream.log("world/arm/joints", &Points3D::new(places).with_colors([color(TRUTH, 255)]).with_radii([0.018]))?;
    for (index, pose) in moment.joints.iter().enumerate() {
        let frame =
            Transform3D::from_translation(single(pose.position_m)).with_quaternion(quaternion(pose.orientation));
        stream.log(format!("world/arm/frames/joint{index}"), &frame)?;
    }
    let ends =
        trace.tool.iter().map(|part| [part.from_m, part.to_m].map(|end| single(moment.tool.point_m(end))).to_vec());
    let radii: Vec<f32> = trace.tool.iter().map(|part| part.radius_m as f32).collect();
    let balls: Vec<[f32; 3]> = ends.clone().flatten().collect();
    let of_balls: Vec<f32> = radii.iter().flat_map(|radius| [*radius; 2]).collect();
    stream.log("world/tool/ends", &Points3D::new(balls).with_radii(of_balls).with_colors([color(ARM, 255)]))?;
    stream.log("world/tool/parts", &LineStrips3D::new(ends).with_radii(radii).with_colors([color(ARM, 255)]))?;
    Ok(())
}

fn particles(stream: &RecordingStream, belief: &SeenBelief) -> Result<(), Error> {
    let objects: Vec<Body> = belief.ghosts.iter().map(|ghost| ghost.scene.object).collect();
    let obstacles: Vec<Body> = belief.ghosts.iter().filter_map(|ghost| ghost.scene.obstacle).collect();
    bodies(stream, "world/belief/object", &objects, OBJECT, GHOST)?;
    bodies(stream, "world/belief/obstacle", &obstacles, OBSTACLE, GHOST)?;
    for (shape, probability) in BodyShape::ALL.into_iter().zip(belief.shape_probability) {
        stream.log(format!("belief/{}", shape.name()), &Scalars::new([probability]))?;
    }
    stream.log("belief/obstacle", &Scalars::new([belief.obstacle_probability]))?;
    for parameter in &belief.parameters {
        let path = path_of(&parameter.name);
        let values = [("low", parameter.low), ("median", parameter.median), ("high", parameter.high)];
        for (end, value) in values.into_iter().chain(parameter.truth.map(|value| ("true", value))) {
            stream.log(format!("{path}/{end}"), &Scalars::new([value]))?;
        }
    }
    Ok(())
}

fn tree(stream: &RecordingStream, search: &SeenSearch) -> Result<(), Error> {
    let visits: Vec<u64> = search.actions.iter().map(|action| action.visits).collect();
    stream.log("tree/visits", &BarChart::new(visits))?;
    for (index, action) in search.actions.iter().enumerate().filter(|(_, action)| action.visits > 0) {
        stream.log(format!("tree/values/action{index}"), &Scalars::new([action.value]))?;
    }
    let sizes = [("nodes", search.nodes), ("simulations", search.simulations), ("depth", search.depth)];
    for (name, value) in sizes {
        stream.log(format!("tree/size/{name}"), &Scalars::new([value as f64]))?;
    }
    Ok(())
}

/// Bodies of one kind, each shape by itself: an empty one clears what was there before.
fn bodies(stream: &RecordingStream, path: &str, all: &[Body], rgb: [u8; 3], opacity: u8) -> Result<(), Error> {
    let of = |shape: BodyShape| all.iter().filter(move |body| body.shape == shape);
    let centers = |shape| of(shape).map(|body| single(body.pose.position_m)).collect::<Vec<_>>();
    let turns = |shape| of(shape).map(|body| quaternion(body.pose.orientation)).collect::<Vec<_>>();
    let halves = |shape| of(shape).map(|body| single(body.half_m)).collect::<Vec<_>>();
    let colors = [color(rgb, opacity)];
    let fill = if opacity == 255 { FillMode::MajorWireframe } else { FillMode::Solid };
    let boxes = Boxes3D::from_centers_and_half_sizes(centers(BodyShape::Box), halves(BodyShape::Box))
        .with_quaternions(turns(BodyShape::Box))
        .with_colors(colors)
        .with_fill_mode(fill);
    stream.log(format!("{path}/box"), &boxes)?;
    let lengths: Vec<f32> = of(BodyShape::Cylinder).map(|body| 2.0 * body.half_m[2] as f32).collect();
    let radii: Vec<f32> = of(BodyShape::Cylinder).map(|body| body.half_m[0] as f32).collect();
    let cylinders = Cylinders3D::from_lengths_and_radii(lengths, radii)
        .with_centers(centers(BodyShape::Cylinder))
        .with_quaternions(turns(BodyShape::Cylinder))
        .with_colors(colors)
        .with_fill_mode(fill);
    stream.log(format!("{path}/cylinder"), &cylinders)?;
    let spheres = Ellipsoids3D::from_centers_and_half_sizes(centers(BodyShape::Sphere), halves(BodyShape::Sphere))
        .with_colors(colors)
        .with_fill_mode(fill);
    stream.log(format!("{path}/sphere"), &spheres)?;
    Ok(())
}

/// Where the values of a parameter are logged.
fn path_of(name: &str) -> String {
    format!("theta/{}", name.replace(' ', "_"))
}

fn single(point_m: [f64; 3]) -> [f32; 3] {
    point_m.map(|value| value as f32)
}

fn quaternion(xyzw: [f64; 4]) -> Quaternion {
    Quaternion::from_xyzw(xyzw.map(|value| value as f32))
}

fn color([r, g, b]: [u8; 3], opacity: u8) -> Color {
    Color::from_unmultiplied_rgba(r, g, b, opacity)
}
