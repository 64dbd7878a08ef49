//! An episode from above: what was true and what was believed, at some of its moments, and how the belief changed over time.

use figures::{Axis, Chart, Draw, Figure, Lines, Map, Outline, Panel, Reference, Series};
use recording::{Body, BodyShape, EpisodeTrace, Moment, Scene};

/// Maps of a picture: the first moment, the last, and some between.
const MAPS: usize = 6;
const COLUMNS: usize = 3;
/// Around what is shown, m.
const MARGIN_M: f64 = 0.03;
/// Opacity of a ghost that has all probability; a hundred ghosts share it.
const INK: f64 = 3.0;

const GOAL: &str = "goal";
const TOOL: &str = "tool and its way";
const TRUTH: &str = "true object, and its way";
const TRUE_OBSTACLE: &str = "true obstacle";
const OBSTACLE: &str = "believed obstacle";
const BELIEF: &str = "belief: median and 90 %";

/// What a believed object is called in the legend.
const fn believed(shape: BodyShape) -> &'static str {
    match shape {
        BodyShape::Box => "believed box",
        BodyShape::Cylinder => "believed cylinder",
        BodyShape::Sphere => "believed sphere",
    }
}

/// The picture: six maps from above, then shapes and obstacle, friction and mass over the actions.
#[must_use]
pub fn episode_figure(trace: &EpisodeTrace) -> Figure {
    let limits = limits(trace);
    let shown = shown(trace.moments.len());
    let mut panels: Vec<Panel> = shown.iter().map(|index| map(trace, *index, limits)).collect();
    if trace.moments.iter().any(|moment| moment.belief.is_some()) {
        // A row of its own.
        while !panels.len().is_multiple_of(COLUMNS) {
            panels.push(Panel { title: String::new(), chart: Chart::Map(Map { limits, ..Map::default() }) });
        }
        panels.push(probabilities(trace));
        panels.extend(["friction", "mass"].map(|name| parameter(trace, name)));
    }
    // In the order of colours that colour-blind readers tell apart.
    let colors = [
        believed(BodyShape::Box),
        OBSTACLE,
        GOAL,
        believed(BodyShape::Sphere),
        TOOL,
        believed(BodyShape::Cylinder),
        TRUTH,
    ];
    Figure {
        title: trace.title.clone(),
        panels,
        columns: COLUMNS,
        panel_size_px: (330, 300),
        colors: colors.map(str::to_owned).to_vec(),
    }
}

/// Moments that get a map.
fn shown(count: usize) -> Vec<usize> {
    if count <= MAPS {
        return (0..count).collect();
    }
    // Rounded to the nearest.
    (0..MAPS).map(|i| (i * (count - 1) + (MAPS - 1) / 2) / (MAPS - 1)).collect()
}

/// What holds the goal, the tool, the object and the obstacle at all times; the same for all maps.
pub(crate) fn limits(trace: &EpisodeTrace) -> Option<((f64, f64), (f64, f64))> {
    let goal = circle(trace.goal.center_m, trace.goal.radius_m);
    let of_truth = |scene: &Scene| -> Vec<(f64, f64)> {
        [Some(scene.object), scene.obstacle].iter().flatten().flat_map(Body::footprint_m).collect()
    };
    let of_moment = |moment: &Moment| {
        let mut points = moment.truth.as_ref().map(of_truth).unwrap_or_default();
        points.extend(outline_of_tool(trace, moment).into_iter().flatten());
        points
    };
    let points: Vec<(f64, f64)> = goal.into_iter().chain(trace.moments.iter().flat_map(of_moment)).collect();
    let around = |value: fn(&(f64, f64)) -> f64| {
        let low = points.iter().map(value).fold(f64::INFINITY, f64::min);
        let high = points.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
        (low - MARGIN_M, high + MARGIN_M)
    };
    let (x, y) = (around(|p| p.0), around(|p| p.1));
    let good = |(low, high): (f64, f64)| low.is_finite() && high.is_finite() && high > low;
    (good(x) && good(y)).then_some((x, y))
}

fn map(trace: &EpisodeTrace, index: usize, limits: Option<((f64, f64), (f64, f64))>) -> Panel {
    let moment = &trace.moments[index];
    let mut shapes =
        vec![outline(GOAL, circle(trace.goal.center_m, trace.goal.radius_m), Draw::Area { opacity: 0.25 })];
    if let Some(belief) = &moment.belief {
        let opacity = INK / belief.ghosts.len().max(1) as f64;
        for ghost in &belief.ghosts {
            if let Some(obstacle) = &ghost.scene.obstacle {
                shapes.push(outline(OBSTACLE, obstacle.footprint_m(), Draw::Area { opacity }));
            }
            let object = &ghost.scene.object;
            shapes.push(outline(believed(object.shape), object.footprint_m(), Draw::Area { opacity }));
        }
    }
    let so_far = &trace.moments[..=index];
    let way = |place: fn(&Moment) -> Option<[f64; 3]>| {
        so_far.iter().filter_map(place).map(|p| (p[0], p[1])).collect::<Vec<_>>()
    };
    shapes.push(outline(TOOL, way(|m| Some(m.tool.position_m)), Draw::Line));
    for part in outline_of_tool(trace, moment) {
        shapes.push(outline(TOOL, part, Draw::Line));
    }
    shapes.push(outline(TRUTH, way(|m| m.truth.as_ref().map(|t| t.object.pose.position_m)), Draw::Line));
    if let Some(truth) = &moment.truth {
        shapes.push(outline(TRUTH, truth.object.footprint_m(), Draw::Line));
        if let Some(obstacle) = &truth.obstacle {
            shapes.push(Outline { like: TRUTH.into(), ..outline(TRUE_OBSTACLE, obstacle.footprint_m(), Draw::Dashed) });
        }
    }
    let scale_bar = Some((0.1, "10 cm".to_owned()));
    Panel { title: title(trace, index), chart: Chart::Map(Map { limits, shapes, scale_bar }) }
}

fn title(trace: &EpisodeTrace, index: usize) -> String {
    let last = trace.moments.len() - 1;
    let end = if trace.success { "goal" } else { trace.reason.as_str() };
    match index {
        0 => "before the first action".into(),
        1 if last > 1 => "after 1 action".into(),
        _ if index == last => format!("after {index}: {end}"),
        _ => format!("after {index} actions"),
    }
}

fn outline(name: &str, points: Vec<(f64, f64)>, draw: Draw) -> Outline {
    Outline { name: name.into(), like: String::new(), points, draw }
}

pub(crate) fn circle(center_m: [f64; 2], radius_m: f64) -> Vec<(f64, f64)> {
    let point = |i: i32| {
        let angle = std::f64::consts::TAU * f64::from(i) / 48.0;
        (center_m[0] + radius_m * angle.cos(), center_m[1] + radius_m * angle.sin())
    };
    (0..=48).map(point).collect()
}

/// The parts of the tool from above: a ball is a circle, a capsule two half circles.
pub(crate) fn outline_of_tool(trace: &EpisodeTrace, moment: &Moment) -> Vec<Vec<(f64, f64)>> {
    let part = |part: &recording::ToolPart| {
        let from = moment.tool.point_m(part.from_m);
        let to = moment.tool.point_m(part.to_m);
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let along = dy.atan2(dx);
        let half = |center: [f64; 3], start: f64| {
            (0..=16).map(move |i| {
                let angle = start + std::f64::consts::PI * f64::from(i) / 16.0;
                (center[0] + part.radius_m * angle.cos(), center[1] + part.radius_m * angle.sin())
            })
        };
        let mut points: Vec<(f64, f64)> = half(to, along - std::f64::consts::FRAC_PI_2).collect();
        points.extend(half(from, along + std::f64::consts::FRAC_PI_2));
        points.extend(points.first().copied());
        points
    };
    trace.tool.iter().map(part).collect()
}

fn over_time(trace: &EpisodeTrace, value: impl Fn(&recording::SeenBelief) -> f64) -> Vec<(f64, f64)> {
    let moments = trace.moments.iter().enumerate();
    moments.filter_map(|(time, m)| Some((time as f64, value(m.belief.as_ref()?)))).collect()
}

fn actions(trace: &EpisodeTrace) -> Axis {
    let last = trace.moments.len().saturating_sub(1).max(1);
    Axis { limits: Some((0.0, last as f64)), ..Axis::new("actions") }
}

fn probabilities(trace: &EpisodeTrace) -> Panel {
    // Without names of their own: colours are those of the ghosts.
    let series = |like: &str, points| Series { like: like.into(), points, ..Series::default() };
    let mut lines: Vec<Series> = BodyShape::ALL
        .iter()
        .enumerate()
        .map(|(i, shape)| series(believed(*shape), over_time(trace, |b| b.shape_probability[i])))
        .filter(|s| s.points.iter().any(|p| p.1 > 0.0))
        .collect();
    lines.push(series(OBSTACLE, over_time(trace, |b| b.obstacle_probability)));
    let y = Axis { limits: Some((0.0, 1.0)), ..Axis::new("probability") };
    let chart = Lines { x: actions(trace), y, series: lines, references: Vec::new() };
    Panel { title: "what it is, and whether an obstacle is there".into(), chart: Chart::Lines(chart) }
}

fn parameter(trace: &EpisodeTrace, name: &str) -> Panel {
    let of = |belief: &recording::SeenBelief| belief.parameters.iter().find(|p| p.name == name).cloned();
    let all: Vec<_> =
        trace.moments.iter().enumerate().filter_map(|(time, m)| Some((time as f64, of(m.belief.as_ref()?)?))).collect();
    let unit = all.first().map_or(String::new(), |(_, p)| p.unit.clone());
    let label = if unit.is_empty() { name.to_owned() } else { format!("{name} / {unit}") };
    let truth = all.iter().find_map(|(_, p)| p.truth);
    let series = Series {
        name: BELIEF.into(),
        like: GOAL.into(),
        points: all.iter().map(|(t, p)| (*t, p.median)).collect(),
        band: all.iter().map(|(t, p)| (*t, p.low, p.high)).collect(),
        ..Series::default()
    };
    let references = truth.map(|value| Reference { name: "true value".into(), low: value, high: value });
    let chart = Lines {
        x: actions(trace),
        y: Axis::new(label),
        series: vec![series],
        references: references.into_iter().collect(),
    };
    Panel { title: name.into(), chart: Chart::Lines(chart) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_of_the_first_moment_the_last_and_some_between() {
        assert_eq!(shown(1), [0]);
        assert_eq!(shown(3), [0, 1, 2]);
        assert_eq!(shown(21), [0, 4, 8, 12, 16, 20]);
        for count in 1..60 {
            let shown = shown(count);
            assert_eq!(shown.len(), count.min(MAPS));
            assert_eq!((shown[0], shown[shown.len() - 1]), (0, count - 1));
            assert!(shown.windows(2).all(|w| w[0] < w[1]), "{shown:?}");
        }
    }
}
