//! An episode as a moving picture: the map from above, and beside it what the robot believes, one picture an action.

use figures::{Align, Canvas, Color, Film, Type};
use recording::{Body, BodyShape, EpisodeTrace, Moment, Scene, SeenBelief};

use crate::above::{circle, limits, outline_of_tool};
use crate::describe;

/// Size of the pictures, pixels: as wide as a page of text.
const SIZE: (u32, u32) = (840, 470);
/// Corners of the map.
const MAP: ((f64, f64), (f64, f64)) = ((14.0, 48.0), (560.0, 424.0));
/// Columns beside the map: names, bars from and to, and where values end.
const NAMES: f64 = 580.0;
const BARS: (f64, f64) = (684.0, 768.0);
const VALUES: f64 = 828.0;

/// How long a picture is shown, ms: the first, those between, the last.
const HOLD_MS: (u16, u16, u16) = (2000, 600, 4000);
/// Opacity of a ghost that has all probability; a hundred ghosts share it.
const INK: f64 = 3.0;
/// Half the width of the arm's links as drawn, m.
const LINK_M: f64 = 0.022;

const GOAL: usize = 2;
const OBSTACLE: usize = 1;
const TOOL: usize = 4;

/// Colour of a believed shape: that of the picture of the whole episode.
fn color_of(shape: BodyShape) -> Color {
    Color::series(match shape {
        BodyShape::Box => 0,
        BodyShape::Cylinder => 5,
        BodyShape::Sphere => 3,
    })
}

/// The episode as an animated PNG, without end: one picture before the first action and one after each. Equal traces give equal bytes.
///
/// # Errors
///
/// A trace without moments, or what cannot be drawn.
pub fn episode_film(trace: &EpisodeTrace) -> Result<Vec<u8>, figures::Error> {
    let last = trace.moments.len().saturating_sub(1);
    let picture = |index: usize| {
        let hold = match index {
            _ if index == last => HOLD_MS.2,
            0 => HOLD_MS.0,
            _ => HOLD_MS.1,
        };
        Ok((Picture { trace, index, view: View::new(trace) }.draw()?, hold))
    };
    let pictures: Result<Vec<_>, figures::Error> = (0..trace.moments.len()).map(picture).collect();
    Film { pictures: pictures? }.png()
}

/// From the table to pixels. The robot stands above the picture and looks down it: x of its base frame goes down, y to the right.
#[derive(Clone, Copy)]
struct View {
    pixels_a_meter: f64,
    /// What is in the middle of the map, m.
    middle_m: (f64, f64),
}

impl View {
    fn new(trace: &EpisodeTrace) -> Self {
        let ((left, top), (right, bottom)) = MAP;
        let (x, y) = limits(trace).unwrap_or(((0.0, 1.0), (0.0, 1.0)));
        let pixels_a_meter = ((right - left) / (y.1 - y.0)).min((bottom - top) / (x.1 - x.0));
        Self { pixels_a_meter, middle_m: (0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1)) }
    }

    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let ((left, top), (right, bottom)) = MAP;
        let place = |center: f64, value: f64, middle: f64| center + (value - middle) * self.pixels_a_meter;
        (place(0.5 * (left + right), y, self.middle_m.1), place(0.5 * (top + bottom), x, self.middle_m.0))
    }

    fn all(&self, points: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
        points.into_iter().map(|point| self.at(point)).collect()
    }
}

/// One picture of the film.
struct Picture<'a> {
    trace: &'a EpisodeTrace,
    index: usize,
    view: View,
}

fn of_type(size: f64, align: Align, color: Color) -> Type {
    Type { size, align, color }
}

/// A rectangle's outline, closed.
fn frame((left, top): (f64, f64), (right, bottom): (f64, f64)) -> [(f64, f64); 5] {
    [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
}

impl Picture<'_> {
    fn draw(&self) -> Result<Canvas, figures::Error> {
        let mut canvas = Canvas::new(SIZE.0, SIZE.1)?;
        self.title(&mut canvas);
        self.map(&mut canvas);
        self.key(&mut canvas);
        self.caption(&mut canvas);
        self.belief(&mut canvas);
        Ok(canvas)
    }

    fn moment(&self) -> &Moment {
        &self.trace.moments[self.index]
    }

    /// What was true at the start, where the world says it.
    fn truth(&self) -> Option<&Scene> {
        self.trace.moments.iter().find_map(|moment| moment.truth.as_ref())
    }

    fn title(&self, canvas: &mut Canvas) {
        let obstacle = self.truth().is_some_and(|truth| truth.obstacle.is_some());
        let text = if obstacle {
            "Push an object of unknown shape, size, mass and friction into the goal, past an obstacle that no sensor sees"
        } else {
            "Push an object of unknown shape, size, mass and friction into the goal"
        };
        canvas.text(text, (MAP.0.0, 26.0), of_type(14.5, Align::Start, Color::INK));
    }

    fn map(&self, canvas: &mut Canvas) {
        let (low, high) = MAP;
        canvas.rectangle(low, high, Color(0xf6, 0xf5, 0xf2));
        canvas.clip(low, high);
        let goal = self.view.all(circle(self.trace.goal.center_m, self.trace.goal.radius_m));
        canvas.area(goal.clone(), Color::series(GOAL), 0.22);
        canvas.line(&goal, Color::series(GOAL), 1.5);
        self.arm(canvas);
        self.ghosts(canvas);
        self.ways(canvas);
        self.tool(canvas);
        if let Some(truth) = &self.moment().truth {
            if self.moment().belief.is_none() {
                canvas.area(self.view.all(truth.object.footprint_m()), color_of(truth.object.shape), 0.5);
            }
            self.dashes(canvas, &truth.object);
            truth.obstacle.iter().for_each(|obstacle| self.dashes(canvas, obstacle));
        }
        canvas.unclip();
        let middle = self.view.at((self.trace.goal.center_m[0], self.trace.goal.center_m[1]));
        let below = middle.1 + self.trace.goal.radius_m * self.view.pixels_a_meter + 13.0;
        canvas.text("goal", (middle.0, below), of_type(14.0, Align::Middle, Color::series(GOAL)));
        self.scale(canvas);
        canvas.text("seen from above", (high.0 - 10.0, low.1 + 16.0), of_type(13.0, Align::End, Color::SOFT));
        canvas.line(&frame(low, high), Color::SOFT.lighter(0.4), 1.0);
    }

    /// The links of the arm from above, pale, as they hide what is under them.
    fn arm(&self, canvas: &mut Canvas) {
        let joints = self.moment().joints.iter().map(|pose| pose.position_m).chain([self.moment().tool.position_m]);
        let points: Vec<(f64, f64)> = joints.map(|p| self.view.at((p[0], p[1]))).collect();
        let pale = Color::SOFT.lighter(0.72);
        let width = 2.0 * LINK_M * self.view.pixels_a_meter;
        for pair in points.windows(2) {
            let [(a, b), (c, d)] = [pair[0], pair[1]];
            let length = (c - a).hypot(d - b).max(1e-9);
            let (along, across) = (0.5 * width * (c - a) / length, 0.5 * width * (d - b) / length);
            canvas.area(
                vec![
                    (a - across, b + along),
                    (c - across, d + along),
                    (c + across, d - along),
                    (a + across, b - along),
                ],
                pale,
                1.0,
            );
            let disc = |(x, y): (f64, f64)| -> Vec<(f64, f64)> {
                circle([0.0, 0.0], 0.5 * width).into_iter().map(|(dx, dy)| (x + dx, y + dy)).collect()
            };
            canvas.area(disc((a, b)), pale, 1.0);
            canvas.area(disc((c, d)), pale, 1.0);
        }
    }

    fn ghosts(&self, canvas: &mut Canvas) {
        let Some(belief) = &self.moment().belief else { return };
        let opacity = INK / belief.ghosts.len().max(1) as f64;
        for obstacle in belief.ghosts.iter().filter_map(|ghost| ghost.scene.obstacle.as_ref()) {
            canvas.area(self.view.all(obstacle.footprint_m()), Color::series(OBSTACLE), opacity);
        }
        for object in belief.ghosts.iter().map(|ghost| &ghost.scene.object) {
            canvas.area(self.view.all(object.footprint_m()), color_of(object.shape), opacity);
        }
    }

    /// Where tool and object have been.
    fn ways(&self, canvas: &mut Canvas) {
        let so_far = &self.trace.moments[..=self.index];
        let way = |place: fn(&Moment) -> Option<[f64; 3]>| {
            self.view.all(so_far.iter().filter_map(place).map(|p| (p[0], p[1])))
        };
        canvas.line(&way(|m| Some(m.tool.position_m)), Color::series(TOOL), 2.5);
        canvas.line(&way(|m| m.truth.as_ref().map(|t| t.object.pose.position_m)), Color::INK, 1.0);
    }

    fn tool(&self, canvas: &mut Canvas) {
        let parts: Vec<_> = outline_of_tool(self.trace, self.moment()).into_iter().map(|p| self.view.all(p)).collect();
        // One outline around all parts.
        parts.iter().for_each(|part| canvas.line(part, Color::INK, 2.5));
        parts.into_iter().for_each(|part| canvas.area(part, Color::series(TOOL), 1.0));
    }

    fn dashes(&self, canvas: &mut Canvas, body: &Body) {
        canvas.dashed(&self.view.all(body.footprint_m()), Color::INK, 2.0);
    }

    fn scale(&self, canvas: &mut Canvas) {
        let ((left, _), (_, bottom)) = MAP;
        let (x, y) = (left + 12.0, bottom - 14.0);
        let end = x + 0.1 * self.view.pixels_a_meter;
        canvas.line(&[(x, y), (end, y)], Color::INK, 1.5);
        for at in [x, end] {
            canvas.line(&[(at, y - 3.0), (at, y + 3.0)], Color::INK, 1.5);
        }
        canvas.text("10 cm", (end + 6.0, y), of_type(13.0, Align::Start, Color::INK));
    }

    /// What is drawn how, under the map.
    fn key(&self, canvas: &mut Canvas) {
        let y = 447.0;
        let mut x = MAP.0.0;
        let mut entry = |canvas: &mut Canvas, text: &str, swatch: &dyn Fn(&mut Canvas, f64)| {
            swatch(canvas, x);
            canvas.text(text, (x + 30.0, y), of_type(13.5, Align::Start, Color::INK));
            x += 30.0 + Canvas::text_width(text, 13.5) + 20.0;
        };
        if self.trace.moments.iter().any(|moment| moment.belief.is_some()) {
            entry(canvas, "believed (darker: more probable)", &|canvas, x| {
                for (i, shade) in [0.75, 0.5, 0.25].into_iter().enumerate() {
                    let inset = 2.5 * i as f64;
                    let (low, high) = ((x + inset, y - 8.0 + inset), (x + 22.0 - inset, y + 8.0 - inset));
                    canvas.rectangle(low, high, Color::series(0).lighter(shade));
                }
            });
        }
        if self.truth().is_some() {
            entry(canvas, "true", &|canvas, x| {
                canvas.dashed(&frame((x + 1.0, y - 7.0), (x + 21.0, y + 7.0)), Color::INK, 2.0);
            });
        }
        entry(canvas, "tool and its path", &|canvas, x| {
            canvas.line(&[(x, y), (x + 22.0, y)], Color::series(TOOL), 2.5);
            canvas.disc((x + 16.0, y), 6.5, Color::INK);
            canvas.disc((x + 16.0, y), 5.5, Color::series(TOOL));
        });
        entry(canvas, "robot arm", &|canvas, x| {
            canvas.line(&[(x + 4.0, y), (x + 18.0, y)], Color::SOFT.lighter(0.72), 9.0);
        });
    }

    /// Which action this is, and what happened.
    fn caption(&self, canvas: &mut Canvas) {
        let last = self.trace.moments.len() - 1;
        let text = match self.moment().action {
            None => "Start".to_owned(),
            Some(_) => format!("Action {} of {last}", self.index),
        };
        canvas.text(&text, (NAMES, 66.0), of_type(23.0, Align::Start, Color::INK));
        if let Some(arrow) = self.moment().action.map(arrow) {
            canvas.text(
                arrow,
                (VALUES, 66.0),
                of_type(if arrow.is_ascii() { 17.0 } else { 26.0 }, Align::End, Color::series(TOOL)),
            );
        }
        let (text, color) = if self.index == last && self.trace.success {
            ("The object is in the goal".to_owned(), Color::series(GOAL))
        } else if self.index == last {
            (format!("It ends: {}", self.trace.reason), Color::series(OBSTACLE))
        } else {
            (self.moment().events.first().map(|event| sentence(event)).unwrap_or_default(), Color::series(OBSTACLE))
        };
        canvas.text(&text, (NAMES, 96.0), of_type(16.0, Align::Start, color));
    }

    /// What the robot believes: the latest there is, as nothing is learnt from the action that ends the episode.
    fn belief(&self, canvas: &mut Canvas) {
        let so_far = &self.trace.moments[..=self.index];
        let Some(belief) = so_far.iter().rev().find_map(|moment| moment.belief.as_ref()) else { return };
        let truth = self.truth();
        let soft = of_type(14.0, Align::Start, Color::SOFT);
        canvas.text("The robot believes it is", (NAMES, 132.0), soft);
        let mut y = 158.0;
        for (shape, probability) in BodyShape::ALL.into_iter().zip(belief.shape_probability) {
            let ever = |m: &Moment| m.belief.as_ref().is_some_and(|b| b.shape_probability[shape as usize] > 0.0);
            if self.trace.moments.iter().any(ever) {
                let known = truth.map(|t| t.object.shape == shape);
                probability_row(canvas, y, &format!("a {}", shape.name()), probability, color_of(shape), known);
                y += 28.0;
            }
        }
        if self.trace.moments.iter().any(|m| m.belief.as_ref().is_some_and(|b| b.obstacle_probability > 0.0)) {
            y += 14.0;
            canvas.text("and that there is", (NAMES, y), soft);
            y += 26.0;
            let known = truth.map(|t| t.obstacle.is_some());
            probability_row(canvas, y, "an obstacle", belief.obstacle_probability, Color::series(OBSTACLE), known);
            y += 28.0;
        }
        y += 14.0;
        canvas.text("90 % intervals of the object", (NAMES, y), soft);
        for name in ["mass", "friction"] {
            y += 28.0;
            self.interval_row(canvas, y, name, belief);
        }
    }

    /// The 90 % of a parameter, on one scale for the whole episode; dashed: the truth.
    fn interval_row(&self, canvas: &mut Canvas, y: f64, name: &str, belief: &SeenBelief) {
        let of = |b: &SeenBelief| b.parameters.iter().find(|p| p.name == name).cloned();
        let Some(now) = of(belief) else { return };
        let all = self.trace.moments.iter().filter_map(|m| of(m.belief.as_ref()?));
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
            let truth = p.truth.unwrap_or(p.median);
            (low.min(p.low).min(truth), high.max(p.high).max(truth))
        });
        let at = |value: f64| BARS.0 + (BARS.1 - BARS.0) * ((value - low) / (high - low).max(1e-12)).clamp(0.0, 1.0);
        let ink = of_type(16.0, Align::Start, Color::INK);
        canvas.text(name, (NAMES, y), ink);
        canvas.rectangle((BARS.0, y - 9.0), (BARS.1, y + 9.0), Color::SOFT.lighter(0.88));
        canvas.rectangle((at(now.low), y - 9.0), (at(now.high), y + 9.0), Color::series(GOAL).lighter(0.45));
        if let Some(truth) = now.truth {
            canvas.dashed(&[(at(truth), y - 11.0), (at(truth), y + 11.0)], Color::INK, 2.0);
        }
        let unit = if now.unit.is_empty() { String::new() } else { format!(" {}", now.unit) };
        canvas.text(&format!("{:.2}{unit}", now.median), (VALUES, y), of_type(13.0, Align::End, Color::INK));
    }
}

/// A name, a bar and a percentage; `known`: whether it is true, where the world says it.
fn probability_row(canvas: &mut Canvas, y: f64, name: &str, probability: f64, color: Color, known: Option<bool>) {
    canvas.text(name, (NAMES, y), of_type(16.0, Align::Start, Color::INK));
    canvas.rectangle((BARS.0, y - 9.0), (BARS.1, y + 9.0), Color::SOFT.lighter(0.88));
    let end = BARS.0 + (BARS.1 - BARS.0) * probability.clamp(0.0, 1.0);
    canvas.rectangle((BARS.0, y - 9.0), (end, y + 9.0), color);
    if known == Some(true) {
        canvas.dashed(&frame((BARS.0 - 1.0, y - 10.0), (BARS.1 + 1.0, y + 10.0)), Color::INK, 2.0);
    }
    canvas.text(&format!("{:.0} %", 100.0 * probability), (VALUES, y), of_type(16.0, Align::End, Color::INK));
}

/// An action as seen in the map: x of the base frame goes down, y to the right.
fn arrow(action: u8) -> &'static str {
    const ARROWS: [&str; 8] = ["↓", "↘", "→", "↗", "↑", "↖", "←", "↙"];
    ARROWS.get(usize::from(action)).copied().unwrap_or_else(|| describe::action(action))
}

/// With a capital at its start.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use recording::{Goal, Pose, ToolPart};

    use super::*;

    fn body(shape: BodyShape, x: f64, y: f64) -> Body {
        let pose = Pose { position_m: [x, y, 0.0], orientation: [0.0, 0.0, 0.0, 1.0] };
        Body { shape, half_m: [0.04; 3], pose }
    }

    fn trace(truth: bool) -> EpisodeTrace {
        let moment = |action: Option<u8>| Moment {
            action,
            reward: None,
            events: vec!["the obstacle was touched".into()],
            joints: vec![Pose::default()],
            tool: Pose { position_m: [0.4, -0.2, 0.0], orientation: [0.0, 0.0, 0.0, 1.0] },
            truth: truth.then(|| Scene {
                object: body(BodyShape::Cylinder, 0.5, -0.1),
                obstacle: Some(body(BodyShape::Box, 0.5, 0.0)),
            }),
            belief: None,
            search: None,
            update_transitions: None,
        };
        EpisodeTrace {
            goal: Goal { center_m: [0.5, 0.1], radius_m: 0.05 },
            tool: vec![ToolPart { from_m: [0.0; 3], to_m: [0.0; 3], radius_m: 0.02 }],
            moments: vec![moment(None), moment(Some(2)), moment(Some(9))],
            ..EpisodeTrace::default()
        }
    }

    #[test]
    fn what_lies_ahead_of_the_robot_is_below_and_its_left_is_at_the_right() {
        let view = View::new(&trace(true));
        let [middle, ahead, left] = [(0.5, 0.0), (0.6, 0.0), (0.5, 0.1)].map(|point| view.at(point));
        assert!(ahead.1 > middle.1 && (ahead.0 - middle.0).abs() < 1e-9);
        assert!(left.0 > middle.0 && (left.1 - middle.1).abs() < 1e-9);
        assert!((ahead.1 - middle.1 - (left.0 - middle.0)).abs() < 1e-9, "one scale");
    }

    #[test]
    fn an_episode_is_filmed_whether_or_not_anything_is_believed_or_known() {
        for truth in [true, false] {
            let trace = trace(truth);
            let film = episode_film(&trace).unwrap();
            assert_eq!(film, episode_film(&trace).unwrap());
            assert!(film.starts_with(b"\x89PNG") && film.windows(4).filter(|kind| kind == b"fcTL").count() == 3);
        }
        assert!(episode_film(&EpisodeTrace::default()).is_err());
    }
}
