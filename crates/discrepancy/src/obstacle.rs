//! Where something that no sensor tracks may stand in the way.
//!
//! Each episode says two things of a place: whatever went by it freely shows that nothing stands there, and where an object leaves its simulated
//! path, or a tool meets a force that the simulation does not know of, something may stand just behind, on the side that it was pushed from. Places
//! on a grid count such votes.

use physics_model::rig::RigReading;

use crate::trial::{Happened, Trial};

mod refine;

pub(crate) use refine::refined_place;

/// Distance of grid points, m.
const GRID_M: f64 = 0.01;
/// Radii of what is looked for, m.
const RADII_M: [f64; 5] = [0.012, 0.018, 0.025, 0.033, 0.042];
/// Least and largest radius, m.
const RANGE_M: [f64; 2] = [0.01, 0.06];
/// Steps, m, by which a circle on the grid is moved and grown.
const FINER_M: [f64; 3] = [0.005, 0.0025, 0.00125];
/// Rows that are averaged.
const ROWS: usize = 8;
/// How far, m, an object has to be off its simulated path.
const OFF_M: f64 = 0.004;
/// How far off, m, it was when it began to leave.
const BEGINS_M: f64 = 0.001;
/// A force, N, on a tool that friction does not explain.
const UNEXPECTED_N: f64 = 1.0;
/// How well, m, a place of contact is known.
const TOLERANCE_M: f64 = 0.006;
/// What goes by may come nearer than it can by this, m: its place is not known exactly.
const GRAZES_M: f64 = 0.003;
/// Passing by counts against a place this much more than an event counts for it.
const PASSED: f64 = 2.0;
/// How far apart, m, places are that are worth trying both, and how different radii.
const APART_M: f64 = 0.025;
const WIDER_M: f64 = 0.01;

/// What an episode says.
struct Witness {
    /// What went by before the event.
    before: Vec<Happened>,
    event: Option<Event>,
}

/// Something pushed.
struct Event {
    /// When.
    row: Happened,
    /// Whether it was the tool itself.
    tool: bool,
    /// Direction in which it was pushed.
    direction: [f64; 2],
}

/// What moves, as seen from above.
#[derive(Clone, Copy, Debug)]
pub struct Outlines {
    /// Half the sides of a box, m.
    pub sides_m: Option<[f64; 2]>,
    /// Radius of the object, m.
    pub object_m: f64,
    /// Radius of the tool, m.
    pub tool_m: f64,
}

impl Outlines {
    /// Distance, m, of a point from the object.
    fn off_object(&self, point: [f64; 2], row: &Happened) -> f64 {
        match self.sides_m {
            Some(sides_m) => {
                let (sin, cos) = row.yaw_rad.sin_cos();
                let (dx, dy) = (point[0] - row.object[0], point[1] - row.object[1]);
                let own = [cos * dx + sin * dy, cos * dy - sin * dx];
                let [x, y] = [0, 1].map(|axis: usize| own[axis].abs() - sides_m[axis]);
                x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0)
            }
            None => distance(point, row.object) - self.object_m,
        }
    }

    /// Corners, or four points of the rim, as seen from above, m: what the object stands on.
    pub(crate) fn feet(&self, row: &Happened) -> [[f64; 2]; 4] {
        let (sin, cos) = row.yaw_rad.sin_cos();
        let feet = match self.sides_m {
            Some([a, b]) => [[a, b], [a, -b], [-a, b], [-a, -b]],
            None => [[self.object_m, 0.0], [-self.object_m, 0.0], [0.0, self.object_m], [0.0, -self.object_m]],
        };
        feet.map(|[x, y]| [row.object[0] + cos * x - sin * y, row.object[1] + sin * x + cos * y])
    }

    /// Distance, m, of a point from the tool.
    fn off_tool(&self, point: [f64; 2], row: &Happened) -> f64 {
        row.tool.map_or(f64::INFINITY, |tool| distance(point, tool) - self.tool_m)
    }
}

/// Where something may stand, m, and its radius, m.
pub type Place = ([f64; 2], f64);

/// What all episodes say, one after another.
pub(crate) struct Seen {
    witnesses: Vec<Witness>,
    outlines: Outlines,
}

impl Seen {
    /// Each trial comes with its simulated readings.
    pub(crate) fn new(trials: &[(&Trial, Vec<RigReading>)], outlines: Outlines) -> Self {
        let witness = |(trial, readings): &(&Trial, Vec<RigReading>)| witness(&trial.happened(readings), outlines);
        Self { witnesses: trials.iter().map(witness).collect(), outlines }
    }

    /// Places, the likeliest first, at most `count`.
    pub(crate) fn places(&self, count: usize) -> Vec<Place> {
        let Outlines { object_m, tool_m, .. } = self.outlines;
        let events = self.witnesses.iter().filter_map(|witness| witness.event.as_ref());
        let around = object_m.max(tool_m) + RADII_M[RADII_M.len() - 1] + TOLERANCE_M;
        let pushed = events.map(|event| event.row.tool.filter(|_| event.tool).unwrap_or(event.row.object));
        let Some((low, high)) = corners(pushed, around) else { return Vec::new() };
        let votes = |place, radius_m| self.votes(&(place, radius_m));
        let near = |a: &Place, b: &Place| (a.1 - b.1).abs() < WIDER_M && distance(a.0, b.0) < APART_M;
        let places = best_places((low, high), GRID_M, &RADII_M, votes, near, count);
        let same = |a: &Place, b: &Place| (a.1 - b.1).abs() < 0.5 * WIDER_M && distance(a.0, b.0) < WIDER_M;
        finer_places(places, &FINER_M, RANGE_M, votes, same)
    }

    fn votes(&self, (place, radius_m): &Place) -> f64 {
        self.witnesses.iter().map(|witness| witness.vote(*place, *radius_m, self.outlines)).sum()
    }

    /// How near, m, object or tool come to a body in the course at this place until something happens; below 0 where they would be in it.
    fn apart_m(&self, course: usize, (place, radius_m): Place) -> f64 {
        let witness = &self.witnesses[course];
        let rows = witness.before.iter().chain(witness.event.as_ref().map(|event| &event.row));
        let apart_m = |row| self.outlines.off_object(place, row).min(self.outlines.off_tool(place, row));
        rows.map(apart_m).fold(f64::INFINITY, f64::min) - radius_m
    }
}

/// Of circles on a grid between two corners those with the highest scores above 0, at most `count`, none near a better one.
pub(crate) fn best_places(
    (low, high): ([f64; 2], [f64; 2]),
    grid_m: f64,
    radii_m: &[f64],
    score: impl Fn([f64; 2], f64) -> f64,
    near: impl Fn(&Place, &Place) -> bool,
    count: usize,
) -> Vec<Place> {
    let cells = |axis: usize| ((high[axis] - low[axis]) / grid_m).ceil() as usize + 1;
    let mut found: Vec<(f64, Place)> = Vec::new();
    for i in 0..cells(0) {
        for j in 0..cells(1) {
            let place = [low[0] + i as f64 * grid_m, low[1] + j as f64 * grid_m];
            let scored = radii_m.iter().map(|radius_m| (score(place, *radius_m), (place, *radius_m)));
            found.extend(scored.filter(|(score, _)| *score > 0.0));
        }
    }
    best_apart(found, near, count)
}

/// Those with the highest scores, at most `count`, none near a better one.
fn best_apart(mut scored: Vec<(f64, Place)>, near: impl Fn(&Place, &Place) -> bool, count: usize) -> Vec<Place> {
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<Place> = Vec::new();
    for (_, place) in scored {
        if chosen.len() == count {
            break;
        }
        if !chosen.iter().any(|other| near(other, &place)) {
            chosen.push(place);
        }
    }
    chosen
}

/// Circles moved and grown by steps, larger ones first, to where their scores are highest nearby; the best first, none the same as a better one.
pub(crate) fn finer_places(
    places: Vec<Place>,
    steps_m: &[f64],
    radii_m: [f64; 2],
    score: impl Fn([f64; 2], f64) -> f64,
    same: impl Fn(&Place, &Place) -> bool,
) -> Vec<Place> {
    let scored = |place: Place| (score(place.0, place.1), place);
    let around = |(_, place), step_m| circles(place, step_m, 1, radii_m).map(scored).collect();
    let moved = places.into_iter().map(|place| climb(scored(place), steps_m, around, |(score, _)| *score));
    best_apart(moved.collect(), same, usize::MAX)
}

/// A circle and its neighbours on a grid, so many to each side along both axes and in radius, as far as they are within a range of radii.
fn circles(([x, y], radius_m): Place, grid_m: f64, count: u32, radii_m: [f64; 2]) -> impl Iterator<Item = Place> {
    let across = 2 * count + 1;
    (0..across.pow(3))
        .map(move |code| {
            let steps = [code % across, code / across % across, code / (across * across)];
            let [dx, dy, dr] = steps.map(|n| grid_m * (f64::from(n) - f64::from(count)));
            ([x + dx, y + dy], radius_m + dr)
        })
        .filter(move |place| (radii_m[0]..=radii_m[1]).contains(&place.1))
}

/// Goes to the best one around as long as that is better, by the first step, then by the next.
fn climb<T: Copy>(begin: T, steps_m: &[f64], around: impl Fn(T, f64) -> Vec<T>, score: impl Fn(&T) -> f64) -> T {
    let mut best = begin;
    for step_m in steps_m {
        loop {
            match around(best, *step_m).into_iter().max_by(|a, b| score(a).total_cmp(&score(b))) {
                Some(next) if score(&next) > score(&best) => best = next,
                _ => break,
            }
        }
    }
    best
}

fn witness(rows: &[Happened], outlines: Outlines) -> Witness {
    let averaged: Vec<Happened> = rows.chunks(ROWS).map(average).collect();
    let off = |row: &Happened| distance(row.object, row.simulated);
    let force = |row: &Happened| row.surprise_n[0].hypot(row.surprise_n[1]);
    let left = averaged.iter().position(|row| off(row) > OFF_M);
    let begins = left.map(|left| {
        let before = averaged[..left].iter().rposition(|row| off(row) < BEGINS_M);
        (before.map_or(0, |before| before + 1), left)
    });
    let felt = averaged.iter().position(|row| force(row) > UNEXPECTED_N);
    let (end, event) = match (begins, felt) {
        (Some((begins, left)), felt) if felt.is_none_or(|felt| begins < felt) => {
            let (size, row) = (off(&averaged[left]), &averaged[left]);
            let direction = std::array::from_fn(|axis| (row.object[axis] - row.simulated[axis]) / size);
            (begins, Some(Event { row: averaged[begins], tool: false, direction }))
        }
        (_, Some(felt)) => {
            let row = averaged[felt];
            let direction = row.surprise_n.map(|f| f / force(&row));
            // The tool itself, or an object that it pushes.
            let touches = |tool| outlines.off_object(tool, &row) < outlines.tool_m + 2.0 * TOLERANCE_M;
            (felt, Some(Event { row, tool: row.tool.is_some_and(|tool| !touches(tool)), direction }))
        }
        _ => (averaged.len(), None),
    };
    Witness { before: averaged[..end].to_vec(), event }
}

/// The mean of rows.
pub(crate) fn average(rows: &[Happened]) -> Happened {
    let mean = |pick: &dyn Fn(&Happened) -> [f64; 2]| {
        let sum = rows.iter().map(pick).fold([0.0; 2], |sum, point| [sum[0] + point[0], sum[1] + point[1]]);
        sum.map(|sum| sum / rows.len() as f64)
    };
    Happened {
        object: mean(&|row| row.object),
        simulated: mean(&|row| row.simulated),
        yaw_rad: rows[rows.len() / 2].yaw_rad,
        tool: rows[0].tool.map(|first| mean(&|row| row.tool.unwrap_or(first))),
        surprise_n: mean(&|row| row.surprise_n),
        force_n: mean(&|row| row.force_n),
    }
}

impl Witness {
    fn vote(&self, place: [f64; 2], radius_m: f64, outlines: Outlines) -> f64 {
        let least_m = radius_m - GRAZES_M;
        let through =
            |row: &Happened| outlines.off_object(place, row) < least_m || outlines.off_tool(place, row) < least_m;
        if self.before.iter().any(through) {
            return -PASSED;
        }
        self.event.as_ref().map_or(0.0, |event| {
            let (row, tool) = (&event.row, event.row.tool.filter(|_| event.tool));
            let pushed = tool.unwrap_or(row.object);
            let away = [pushed[0] - place[0], pushed[1] - place[1]];
            let along =
                (away[0] * event.direction[0] + away[1] * event.direction[1]) / away[0].hypot(away[1]).max(1e-9);
            let apart_m = if event.tool { outlines.off_tool(place, row) } else { outlines.off_object(place, row) };
            let miss = (apart_m - radius_m) / TOLERANCE_M;
            if along > 0.0 { along * (-0.5 * miss * miss).exp() } else { 0.0 }
        })
    }
}

/// Of two places, m.
pub(crate) fn distance([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    (ax - bx).hypot(ay - by)
}

/// Corners of the smallest rectangle around points, wider by `around_m`.
pub(crate) fn corners(points: impl Iterator<Item = [f64; 2]>, around_m: f64) -> Option<([f64; 2], [f64; 2])> {
    let wide = |corners: Option<([f64; 2], [f64; 2])>, [x, y]: [f64; 2]| {
        let (low, high) = corners.unwrap_or(([x, y], [x, y]));
        Some(([low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]))
    };
    let (low, high) = points.fold(None, wide)?;
    Some((low.map(|v| v - around_m), high.map(|v| v + around_m)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTLINES: Outlines = Outlines { sides_m: Some([0.04, 0.03]), object_m: 0.05, tool_m: 0.02 };

    /// A push along `yaw_rad` through `through` that a round body stops, or does not.
    fn push(yaw_rad: f64, through: [f64; 2], body: Option<Place>) -> Vec<Happened> {
        let (sin, cos) = yaw_rad.sin_cos();
        let at = |along: f64| [through[0] + along * cos, through[1] + along * sin];
        let mut last = -0.1;
        (0..200)
            .map(|row| {
                let simulated = -0.1 + 0.001 * f64::from(row);
                let here = |along: f64| Happened {
                    object: at(along),
                    simulated: at(simulated),
                    yaw_rad,
                    tool: Some(at(along - 0.06)),
                    surprise_n: [0.0; 2],
                    force_n: [0.0; 2],
                };
                if body.is_none_or(|(place, radius_m)| OUTLINES.off_object(place, &here(simulated)) > radius_m) {
                    last = simulated;
                }
                let mut row = here(last);
                if last < simulated {
                    row.surprise_n = [-5.0 * cos, -5.0 * sin];
                }
                row
            })
            .collect()
    }

    #[test]
    fn pushes_that_are_stopped_tell_where_and_those_that_pass_where_not() {
        let body = ([0.02, -0.01], 0.025);
        let seen = |witnesses| Seen { witnesses, outlines: OUTLINES };
        let pushes = [0.0, 1.1, 2.5, 4.0].map(|yaw| witness(&push(yaw, body.0, Some(body)), OUTLINES));
        assert!(pushes.iter().all(|push| push.vote(body.0, body.1, OUTLINES) > 0.8));
        let (place, radius_m) = seen(pushes.into()).places(3)[0];
        assert!(distance(place, body.0) < 0.003 && (radius_m - body.1).abs() < 0.003, "{place:?} {radius_m}");
        let passing = witness(&push(0.5, body.0, None), OUTLINES);
        assert!(passing.event.is_none());
        assert_eq!(passing.vote(body.0, body.1, OUTLINES), -PASSED);
        assert_eq!(passing.vote([0.3, 0.3], body.1, OUTLINES), 0.0);
        assert!(seen(vec![passing]).places(3).is_empty());
    }

    #[test]
    fn a_push_comes_as_near_to_a_body_as_it_is_seen_to() {
        let seen = |rows: &[Happened]| Seen { witnesses: vec![witness(rows, OUTLINES)], outlines: OUTLINES };
        let near = |seen: &Seen, place| seen.apart_m(0, (place, 0.02));
        // Along x the sides of the object are 3 cm away, and its tool is behind it.
        let passing = seen(&push(0.0, [0.0, 0.0], None));
        assert!((near(&passing, [0.0, 0.08]) - 0.03).abs() < 1e-9);
        assert!(near(&passing, [0.0, 0.03]) < 0.0);
        // What stops it is touched, what is behind that is not reached.
        let body = ([0.0, 0.0], 0.02);
        let stopped = seen(&push(0.0, [0.0, 0.0], Some(body)));
        assert!(near(&stopped, body.0).abs() < 0.006, "{}", near(&stopped, body.0));
        assert!(near(&stopped, [0.09, 0.0]) > 0.08);
        assert_eq!(near(&seen(&[]), body.0), f64::INFINITY);
    }

    #[test]
    fn a_turned_box_is_as_far_away_as_its_sides_are() {
        let row = &push(std::f64::consts::FRAC_PI_2, [0.0, 0.0], None)[100];
        // Its long side lies along y now.
        assert!((OUTLINES.off_object([0.05, 0.0], row) - 0.02).abs() < 1e-9);
        assert!((OUTLINES.off_object([0.0, 0.05], row) - 0.01).abs() < 1e-9);
        assert!((OUTLINES.off_object([0.033, 0.044], row) - 0.005).abs() < 1e-9);
        assert!(OUTLINES.off_object([0.0, 0.0], row) < 0.0);
    }
}
