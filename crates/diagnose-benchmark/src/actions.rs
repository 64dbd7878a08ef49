//! What is done to an object while a log is recorded.

use pomdp::Rng;
use rand::RngExt as _;

/// One episode: where the object begins and where the tool is sent.
#[derive(Clone, Debug)]
pub struct Script {
    /// Centre of the object, m, over its resting place.
    pub place_m: [f64; 2],
    /// Height, m, over its resting height.
    pub lift_m: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// Known weight, kg.
    pub added_mass_kg: f64,
    /// Commands, one a tick; the first is where the tool begins.
    pub commands: Vec<[f64; 3]>,
}

impl Script {
    /// The same elsewhere.
    pub fn shift(&mut self, by_m: [f64; 2]) {
        for (axis, by) in by_m.into_iter().enumerate() {
            self.place_m[axis] += by;
            self.commands.iter_mut().for_each(|command| command[axis] += by);
        }
    }

    /// Shifted as little as brings all commands between two corners, which must be farther apart than they are.
    pub fn fit_into(&mut self, low_m: [f64; 2], high_m: [f64; 2]) {
        let by = std::array::from_fn(|axis| {
            let places = || self.commands.iter().map(|command| command[axis]);
            let (least, most) = (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
            (low_m[axis] - least).max(0.0) + (high_m[axis] - most).min(0.0)
        });
        self.shift(by);
    }

    /// Distance, m, of a point from the object at the start, and from the way of the tool.
    fn clearance_m(&self, point_m: [f64; 2]) -> (f64, f64) {
        let from = |x: f64, y: f64| (x - point_m[0]).hypot(y - point_m[1]);
        let tool = self.commands.iter().map(|c| from(c[0], c[1])).fold(f64::INFINITY, f64::min);
        (from(self.place_m[0], self.place_m[1]), tool)
    }

    /// Where the object's centre is pushed to, roughly, m: as far beyond its place as the tool goes beyond where it touches.
    fn pushed_to_m(&self, touch_m: f64) -> [f64; 2] {
        let first = self.commands[0];
        let along = [self.place_m[0] - first[0], self.place_m[1] - first[1]];
        let length = along[0].hypot(along[1]).max(1e-9);
        let ahead = |c: &[f64; 3]| ((c[0] - first[0]) * along[0] + (c[1] - first[1]) * along[1]) / length;
        let farthest = self.commands.iter().map(ahead).fold(0.0, f64::max);
        let share = (farthest + touch_m - length).max(0.0) / length;
        [self.place_m[0] + share * along[0], self.place_m[1] + share * along[1]]
    }
}

/// A place for an obstacle of this radius that pushed objects meet, and tools do not: of 40 drawn ones that which most do.
#[must_use]
pub fn place_obstacle(scripts: &[Script], scene: &Scene, radius_m: f64, tool_radius_m: f64, rng: &mut Rng) -> [f64; 2] {
    let reach_m = scene.touch_m - tool_radius_m;
    let mut best = ([scene.centre_m[0] + 0.12, scene.centre_m[1]], 0);
    for _ in 0..40 {
        let place: [f64; 2] = std::array::from_fn(|axis| scene.centre_m[axis] + rng.random_range(-0.16..0.16));
        let meets = |script: &&Script| {
            let (object, tool) = script.clearance_m(place);
            let to = script.pushed_to_m(scene.touch_m);
            let end = (to[0] - place[0]).hypot(to[1] - place[1]);
            object > reach_m + radius_m && tool > tool_radius_m + radius_m && end < reach_m + radius_m - 0.015
        };
        let count = scripts.iter().filter(meets).count();
        if count > best.1 {
            best = (place, count);
        }
    }
    best.0
}

/// One script in so many ends at an obstacle: one that nothing meets cannot be found.
const MEETS: usize = 6;

/// Moves what would begin in an obstacle, or send the tool into it: nobody puts an object where something stands. Some pushes are moved to it.
pub fn avoid(scripts: &mut [Script], scene: &Scene, (place_m, radius_m): ([f64; 2], f64), rng: &mut Rng) {
    // Touch is reach and the tool's radius, at least as much as either needs.
    let (object_m, tool_m) = (scene.touch_m + radius_m - 0.01, 0.03 + radius_m);
    for (index, script) in scripts.iter_mut().enumerate() {
        let to = script.pushed_to_m(scene.touch_m);
        let along = [to[0] - script.place_m[0], to[1] - script.place_m[1]];
        let length = along[0].hypot(along[1]);
        if index % MEETS == 1 && length > 0.03 {
            // Centres end this far apart if the obstacle gives way by 1 to 3 cm.
            let apart = scene.touch_m - 0.02 + radius_m - rng.random_range(0.01..0.03);
            script.shift(std::array::from_fn(|axis| place_m[axis] - apart * along[axis] / length - to[axis]));
        }
        for _ in 0..50 {
            let (object, tool) = script.clearance_m(place_m);
            if object > object_m && tool > tool_m {
                break;
            }
            let by =
                std::array::from_fn(|axis| scene.centre_m[axis] + rng.random_range(-0.2..0.2) - script.place_m[axis]);
            script.shift(by);
        }
    }
}

/// What a script needs to know of the scene.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// Tick, s.
    pub period_secs: f64,
    /// Height of the tool's centre while it pushes, m.
    pub tool_height_m: f64,
    /// From the object's centre to where the tool's centre touches it at most, m.
    pub touch_m: f64,
    /// The same from which on they do not touch, whichever part of the tool leads.
    pub clear_m: f64,
    /// The same along the object's own x axis.
    pub face_m: f64,
    /// Half the width of the object across the push, m.
    pub half_width_m: f64,
    /// Whether what is touched rolls away.
    pub rolls: bool,
    /// Centre of the scene, m.
    pub centre_m: [f64; 2],
}

/// Places along a path, a tick apart.
struct Path {
    period_secs: f64,
    points: Vec<[f64; 3]>,
}

impl Path {
    fn from(period_secs: f64, start: [f64; 3]) -> Self {
        Self { period_secs, points: vec![start] }
    }

    fn end(&self) -> [f64; 3] {
        self.points[self.points.len() - 1]
    }

    fn wait(&mut self, secs: f64) {
        let end = self.end();
        let ticks = (secs / self.period_secs).round() as usize;
        self.points.extend(std::iter::repeat_n(end, ticks));
    }

    /// Speeds up within 0.1 s, goes at `speed_mps`, slows down within `brake_secs`.
    fn go(&mut self, to: [f64; 3], speed_mps: f64, brake_secs: f64) {
        let from = self.end();
        let length = (0..3).map(|i| (to[i] - from[i]).powi(2)).sum::<f64>().sqrt();
        if length == 0.0 {
            return;
        }
        let start_secs = 0.1_f64;
        let speed = speed_mps.min(length / (0.5 * (start_secs + brake_secs)) * 0.99);
        let cruise = (length - 0.5 * speed * (start_secs + brake_secs)) / speed;
        let total = start_secs + cruise + brake_secs;
        let way = |t: f64| {
            let up = t.min(start_secs);
            let mid = (t - start_secs).clamp(0.0, cruise);
            let down = (t - start_secs - cruise).clamp(0.0, brake_secs);
            speed * (0.5 * up * up / start_secs + mid + down - 0.5 * down * down / brake_secs)
        };
        let ticks = (total / self.period_secs).ceil() as usize;
        for tick in 1..=ticks {
            let share = (way(tick as f64 * self.period_secs) / length).min(1.0);
            self.points.push(std::array::from_fn(|i| from[i] + share * (to[i] - from[i])));
        }
    }
}

/// A push.
#[derive(Clone, Copy, Debug)]
struct Push {
    angle_rad: f64,
    aside_m: f64,
    speed_mps: f64,
    distance_m: f64,
    /// Whether it begins slower than what sticks lets go at.
    creeps: bool,
}

/// To the object and a little on, a stop, and on slower than what sticks lets go at. Who creeps towards an object instead
/// measures where it begins to a tenth of a millimetre: there the smallest error of a pose explains as much as any friction.
fn creep(scene: &Scene, path: &mut Path, at: impl Fn(f64) -> [f64; 3]) {
    path.go(at(-scene.face_m + 0.008), 0.03, 0.1);
    path.wait(0.2);
    path.go(at(-scene.face_m + 0.01), 0.0003, 0.1);
}

/// A push: to the object, on, a short brake, back, a rest.
fn push(scene: &Scene, place_m: [f64; 2], push: Push) -> Vec<[f64; 3]> {
    let Push { angle_rad, aside_m, speed_mps, distance_m, creeps } = push;
    let (sin, cos) = angle_rad.sin_cos();
    let at = |along: f64| {
        [place_m[0] + along * cos - aside_m * sin, place_m[1] + along * sin + aside_m * cos, scene.tool_height_m]
    };
    let begin = -(scene.clear_m + 0.03);
    let mut path = Path::from(scene.period_secs, at(begin));
    path.wait(0.2);
    if creeps {
        creep(scene, &mut path, at);
    }
    path.go(at(-scene.touch_m + distance_m), speed_mps, 0.04);
    path.wait(0.15);
    path.go(at(-scene.touch_m + distance_m - 0.03), 0.1, 0.1);
    path.wait(0.3);
    path.points
}

/// A designed set: eight directions at four speeds, known weights, reversals, creeps, drops, long rests and free motion.
#[must_use]
pub fn designed(scene: &Scene, rng: &mut Rng) -> Vec<Script> {
    let mut draw = || -> f64 { rng.random_range(-1.0..1.0) };
    let mut scripts = Vec::new();
    for (s, speed) in [0.03, 0.08, 0.16, 0.3].into_iter().enumerate() {
        for direction in 0..8 {
            let place_m = [scene.centre_m[0] + 0.1 * draw(), scene.centre_m[1] + 0.1 * draw()];
            let angle = f64::from(direction) * std::f64::consts::FRAC_PI_4;
            // Through the middle, left and right of it.
            let aside = [0.0, 0.35, -0.35][(direction as usize + s) % 3] * scene.half_width_m;
            // What turns is not met where its face would be.
            let creeps = s == 0 && direction % 2 == 0 && !scene.rolls;
            let way = Push { angle_rad: angle, aside_m: aside, speed_mps: speed, distance_m: 0.08, creeps };
            let commands = push(scene, place_m, way);
            let yaw_rad = if direction % 2 == 0 { 0.0 } else { 0.6 * draw() } + angle;
            let added_mass_kg = if (direction as usize + s) % 4 == 1 { 0.3 } else { 0.0 };
            scripts.push(Script { place_m, lift_m: 0.0, yaw_rad, added_mass_kg, commands });
        }
    }
    for index in 0..2 {
        // Back and forth in the air and at the object: what shows on reversal and where nothing touches.
        let place_m = [scene.centre_m[0] + 0.05 * draw(), scene.centre_m[1] + 0.05 * draw()];
        let start = [place_m[0] - scene.clear_m - 0.05, place_m[1], scene.tool_height_m];
        let mut path = Path::from(scene.period_secs, start);
        path.wait(0.2);
        for (dx, dy, dz) in [(-0.04, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.05, 0.03), (0.0, -0.05, 0.0), (0.0, 0.0, 0.0)]
        {
            path.go([start[0] + dx, start[1] + dy, start[2] + dz], [0.1, 0.25][index], 0.1);
            path.wait(0.1);
        }
        path.go([place_m[0] - scene.touch_m + 0.04, place_m[1], scene.tool_height_m], 0.06, 0.1);
        path.wait(0.5);
        path.go(start, 0.2, 0.1);
        path.wait(0.3);
        scripts.push(Script { place_m, lift_m: 0.0, yaw_rad: 0.0, added_mass_kg: 0.0, commands: path.points });
    }
    for index in 0..2 {
        // A creep, slower than what sticks lets go at, and a walk: what differs between them is no Stribeck friction. What rolls away is walked after.
        let place_m = [scene.centre_m[0] + 0.1 * draw(), scene.centre_m[1] + 0.1 * draw()];
        let angle = f64::from(index) * std::f64::consts::FRAC_PI_2 + 0.3 * draw();
        let (sin, cos) = angle.sin_cos();
        let at = |along: f64| [place_m[0] + along * cos, place_m[1] + along * sin, scene.tool_height_m];
        let mut path = Path::from(scene.period_secs, at(-(scene.clear_m + 0.03)));
        path.wait(0.2);
        if !scene.rolls {
            creep(scene, &mut path, at);
        }
        path.go(at(-scene.face_m + 0.022), 0.006, 0.1);
        path.go(at(-(scene.face_m + 0.02)), 0.1, 0.1);
        path.wait(0.2);
        scripts.push(Script { place_m, lift_m: 0.0, yaw_rad: angle, added_mass_kg: 0.0, commands: path.points });
    }
    for index in 0..2 {
        let place_m = [scene.centre_m[0] + 0.1 * draw(), scene.centre_m[1]];
        let start = [place_m[0] - scene.clear_m - 0.1, place_m[1], scene.tool_height_m];
        let mut path = Path::from(scene.period_secs, start);
        path.wait(0.6);
        let lift_m = [0.03, 0.08][index];
        scripts.push(Script { place_m, lift_m, yaw_rad: 0.3 * draw(), added_mass_kg: 0.0, commands: path.points });
    }
    for _ in 0..2 {
        // What grows with time: a push, a long rest, a push.
        let place_m = scene.centre_m;
        let way = Push { angle_rad: 0.0, aside_m: 0.0, speed_mps: 0.08, distance_m: 0.05, creeps: false };
        let mut commands = push(scene, place_m, way);
        let mut path = Path::from(scene.period_secs, commands[commands.len() - 1]);
        path.wait(25.0);
        let end = path.end();
        path.go([end[0] + 0.1, end[1], end[2]], 0.08, 0.04);
        path.wait(0.2);
        path.go(end, 0.1, 0.1);
        commands.extend(&path.points[1..]);
        scripts.push(Script { place_m, lift_m: 0.0, yaw_rad: 0.0, added_mass_kg: 0.0, commands });
    }
    scripts
}

/// A passive log: pushes as they come, at the speeds of everyday work, nothing known added, nothing tried on purpose.
#[must_use]
pub fn passive(scene: &Scene, rng: &mut Rng) -> Vec<Script> {
    let mut draw = || -> f64 { rng.random_range(-1.0..1.0) };
    (0..40)
        .map(|_| {
            let place_m = [scene.centre_m[0] + 0.12 * draw(), scene.centre_m[1] + 0.12 * draw()];
            let angle = std::f64::consts::PI * draw();
            let aside = 0.5 * draw() * scene.half_width_m;
            let speed = 0.12 + 0.08 * draw();
            let distance_m = 0.08 + 0.04 * draw();
            let way = Push { angle_rad: angle, aside_m: aside, speed_mps: speed, distance_m, creeps: false };
            let commands = push(scene, place_m, way);
            Script { place_m, lift_m: 0.0, yaw_rad: angle + 0.5 * draw(), added_mass_kg: 0.0, commands }
        })
        .collect()
}
