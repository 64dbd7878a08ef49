//! The rows of the regression: which are fitted and which are held out, how large and how lasting what is left is, and columns in units of it.
//!
//! What no hypothesis explains is a first-order autoregression in each joint, with one standard deviation where the joint moves and one where it stands.
//! Both, and the weight of rows that stand out (Student's t), come from what the whole catalogue together leaves. So a hypothesis is judged by the
//! discrepancy that the best description at hand has (Kennedy and O'Hagan 2001), not by the noise of a sensor.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use crate::features::{Catalogue, Feature};
use crate::prepared::Prepared;

/// Degrees of freedom of Student's t.
const TAIL: f64 = 4.0;

/// Of a joint that stands: so many times its friction is left out of account.
const MUCH: f64 = 5.0;

/// A row that counts: its joint, its window and the window before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) joint: usize,
    pub(crate) window: usize,
    pub(crate) before: usize,
}

/// Rows of one kind, joint after joint.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub(crate) rows: Vec<Row>,
    /// First row of each joint, and the number of rows.
    pub(crate) starts: Vec<usize>,
}

impl Rows {
    pub(crate) fn of(&self, joint: usize) -> std::ops::Range<usize> {
        self.starts[joint]..self.starts[joint + 1]
    }
}

/// What is left of a joint.
#[derive(Clone, Debug)]
pub(crate) struct Discrepancy {
    /// N·m, where the joint moves and where it stands.
    pub(crate) moving: f64,
    pub(crate) standing: f64,
    /// Correlation of a window with the next.
    pub(crate) lasting: f64,
}

/// Rows and their units.
pub(crate) struct Design {
    pub(crate) fitted: Rows,
    pub(crate) held_out: Rows,
    pub(crate) discrepancy: Vec<Discrepancy>,
    /// Square root of the weight, `[joint][window]`.
    weight: Vec<Vec<f64>>,
    stands: Vec<Vec<bool>>,
    /// Measured less nominal torque, joint after joint, N·m.
    pub(crate) gap: Vec<f64>,
    windows: usize,
}

/// A column in units of the discrepancy.
#[derive(Clone, Debug)]
pub(crate) struct White {
    pub(crate) joint: Option<usize>,
    /// Of the fitted rows: of one joint, or of all.
    pub(crate) values: Vec<f64>,
}

impl White {
    /// Sum of products over the rows that both have.
    pub(crate) fn dot(&self, other: &Self, rows: &Rows) -> f64 {
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum();
        match (self.joint, other.joint) {
            (None, None) => sum(&self.values, &other.values),
            (Some(a), Some(b)) if a == b => sum(&self.values, &other.values),
            (Some(_), Some(_)) => 0.0,
            (Some(joint), None) => sum(&self.values, &other.values[rows.of(joint)]),
            (None, Some(joint)) => sum(&self.values[rows.of(joint)], &other.values),
        }
    }
}

impl Design {
    /// Holds out a share of the pieces, drawn by `seed`.
    pub(crate) fn new(prepared: &Prepared, share: f64, seed: u64) -> Self {
        let windows = prepared.windows.len();
        let gap: Vec<f64> = (0..prepared.joints())
            .flat_map(|joint| {
                let nominal = prepared.nominal[joint].iter().zip(prepared.known_friction(joint));
                let gap = prepared.measured[joint]
                    .iter()
                    .zip(nominal)
                    .map(|(measured, (rigid, known))| measured - rigid - known);
                prepared.means(&gap.collect::<Vec<_>>())
            })
            .collect();
        let held = held_out(prepared.pieces, share, seed);
        let (mut fitted, mut held_out) = (Rows::default(), Rows::default());
        for joint in 0..prepared.joints() {
            for rows in [&mut fitted, &mut held_out] {
                rows.starts.push(rows.rows.len());
            }
            for window in 1..windows {
                let before = window - 1;
                let there = gap[joint * windows + window].is_finite() && gap[joint * windows + before].is_finite();
                if there && prepared.piece[window] == prepared.piece[before] {
                    let rows = if held[prepared.piece[window]] { &mut held_out } else { &mut fitted };
                    rows.rows.push(Row { joint, window, before });
                }
            }
        }
        for rows in [&mut fitted, &mut held_out] {
            rows.starts.push(rows.rows.len());
        }
        let discrepancy = (0..prepared.joints())
            .map(|joint| {
                let stddev = prepared.noise[joint].max(0.02 * prepared.scale[joint]);
                Discrepancy { moving: stddev, standing: stddev, lasting: 0.0 }
            })
            .collect();
        Self {
            fitted,
            held_out,
            discrepancy,
            weight: vec![vec![1.0; windows]; prepared.joints()],
            stands: (0..prepared.joints()).map(|joint| prepared.stands(joint)).collect(),
            gap,
            windows,
        }
    }

    /// A column of torques, joint after joint or of one joint, over some rows.
    pub(crate) fn whiten(&self, joint: Option<usize>, values: &[f64], rows: &Rows) -> White {
        let range = joint.map_or(0..rows.rows.len(), |joint| rows.of(joint));
        let white = rows.rows[range].iter().map(|row| {
            let offset = if joint.is_some() { 0 } else { row.joint * self.windows };
            let lasting = self.discrepancy[row.joint].lasting;
            let [now, before] =
                [row.window, row.before].map(|window| values[offset + window] / self.stddev(row.joint, window));
            self.weight[row.joint][row.window] * (now - lasting * before) / (1.0 - lasting * lasting).sqrt()
        });
        White { joint, values: white.collect() }
    }

    pub(crate) fn whiten_feature(&self, feature: &Feature, rows: &Rows) -> White {
        self.whiten(feature.joint, &feature.values, rows)
    }

    pub(crate) fn target(&self, rows: &Rows) -> White {
        self.whiten(None, &self.gap, rows)
    }

    pub(crate) fn stddev(&self, joint: usize, window: usize) -> f64 {
        let discrepancy = &self.discrepancy[joint];
        if self.stands[joint][window] { discrepancy.standing } else { discrepancy.moving }
    }

    pub(crate) fn stands(&self, joint: usize, window: usize) -> bool {
        self.stands[joint][window]
    }

    /// Learns the discrepancy from what a fit with some number of effective values left, joint after joint, N·m. `coulomb`: friction of each joint, N·m. A
    /// joint that stands may hold any torque up to that, mostly that of its last motion: its rows say next to nothing where friction counts.
    pub(crate) fn learn(&mut self, left: &[f64], values: f64, coulomb: &[f64], prepared: &Prepared) {
        let joints = self.discrepancy.len();
        for joint in 0..joints {
            let rows = &self.fitted.rows[self.fitted.of(joint)];
            let at = |window: usize| left[joint * self.windows + window];
            let share = (1.0 - values / joints as f64 / rows.len().max(1) as f64).max(0.3);
            let spread = |standing: bool| -> Option<f64> {
                let mut squares: Vec<f64> = rows
                    .iter()
                    .filter(|row| self.stands[joint][row.window] == standing)
                    .map(|row| at(row.window).powi(2))
                    .collect();
                if squares.len() < 20 {
                    return None;
                }
                squares.sort_by(f64::total_cmp);
                // Between a median and a mean: what stands out counts, but does not rule.
                let kept = &squares[..squares.len() * 9 / 10];
                Some((kept.iter().sum::<f64>() / kept.len() as f64 / NINE_TENTHS / share).sqrt())
            };
            let floor = 0.3 * prepared.noise[joint];
            let moving = spread(false).or_else(|| spread(true)).unwrap_or(prepared.noise[joint]).max(floor);
            let standing = spread(true).unwrap_or(moving).max(floor).max(MUCH * coulomb[joint].abs());
            self.discrepancy[joint] = Discrepancy { moving, standing, lasting: 0.0 };
            let stands = &self.stands[joint];
            let unit = |window: usize| (at(window) / if stands[window] { standing } else { moving }).clamp(-4.0, 4.0);
            let (mut product, mut square) = (0.0, 0.0);
            for row in rows {
                product += unit(row.window) * unit(row.before);
                square += 0.5 * (unit(row.window).powi(2) + unit(row.before).powi(2));
            }
            let lasting = (product / square.max(1e-12)).clamp(-0.6, 0.95);
            self.discrepancy[joint].lasting = lasting;
            for row in rows {
                let surprise = (unit(row.window) - lasting * unit(row.before)) / (1.0 - lasting * lasting).sqrt();
                self.weight[joint][row.window] = ((TAIL + 1.0) / (TAIL + surprise * surprise)).min(1.0).sqrt();
            }
        }
    }

    /// Sum of squares of what a series leaves over some rows of a joint, in units of `noise`, and their number. Rows in which the joint stands are left out, as what
    /// it holds there is not known; a joint that hardly moves has no others.
    pub(crate) fn chi2(&self, left: &[f64], rows: &Rows, joint: usize, noise: f64) -> (f64, usize) {
        let rows = &rows.rows[rows.of(joint)];
        let moving: Vec<&Row> = rows.iter().filter(|row| !self.stands[joint][row.window]).collect();
        let counted: Vec<&Row> = if moving.len() < rows.len() / 10 { rows.iter().collect() } else { moving };
        let sum = counted.iter().map(|row| (left[joint * self.windows + row.window] / noise).powi(2)).sum();
        (sum, counted.len())
    }

    /// Share of what is left of a joint that ten windows before it foretell: by Levinson's recursion on its autocorrelation.
    pub(crate) fn foretold(&self, left: &[f64], joint: usize, prepared: &Prepared) -> f64 {
        const ORDER: usize = 10;
        let at = |window: usize| {
            let value = left[joint * self.windows + window];
            if self.stands[joint][window] || !value.is_finite() {
                0.0
            } else {
                value.clamp(-4.0 * self.discrepancy[joint].moving, 4.0 * self.discrepancy[joint].moving)
            }
        };
        let mut correlation = [0.0; ORDER + 1];
        for window in 0..self.windows {
            for (lag, sum) in correlation.iter_mut().enumerate() {
                // Pieces follow each other within an episode; across episodes a few products say little.
                if window + lag < self.windows && prepared.piece[window + lag] <= prepared.piece[window] + 1 {
                    *sum += at(window) * at(window + lag);
                }
            }
        }
        if correlation[0] <= 0.0 {
            return 0.0;
        }
        let (mut error, mut weights) = (correlation[0], Vec::<f64>::new());
        for order in 0..ORDER {
            let sum: f64 = weights.iter().enumerate().map(|(i, weight)| weight * correlation[order - i]).sum();
            let reflection = (correlation[order + 1] - sum) / error;
            let turned: Vec<f64> = weights.iter().rev().map(|weight| reflection * weight).collect();
            weights.iter_mut().zip(turned).for_each(|(weight, less)| *weight -= less);
            weights.push(reflection);
            error *= (1.0 - reflection * reflection).max(1e-9);
        }
        (1.0 - error / correlation[0]).clamp(0.0, 1.0)
    }
}

/// Mean square of a standard normal number between its 5 % and 95 % points, times 0.9, over 0.9.
const NINE_TENTHS: f64 = 0.6230;

/// Which pieces are held out: spread over the log, with no pattern that a repeated motion could meet.
fn held_out(pieces: usize, share: f64, seed: u64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..pieces).collect();
    order.sort_by_key(|piece| mix(seed ^ mix(*piece as u64 + 1)));
    let count =
        ((share * pieces as f64).round() as usize).clamp(usize::from(pieces > 1), pieces.saturating_sub(1).max(1));
    let mut held = vec![false; pieces];
    for piece in &order[..count.min(pieces.saturating_sub(1))] {
        held[*piece] = true;
    }
    held
}

/// SplitMix64 (Steele, Lea and Flood 2014).
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// All columns of a catalogue and the target, in units of the discrepancy, over the fitted rows; sums of products are made once.
pub(crate) struct Columns {
    pub(crate) white: Vec<White>,
    pub(crate) target: White,
    rows: Rows,
    /// Of two columns, the later one first; bits of a number, or `UNKNOWN`.
    products: Vec<AtomicU64>,
    with_target: Vec<f64>,
}

/// No sum of products has these bits.
const UNKNOWN: u64 = u64::MAX;

impl Columns {
    pub(crate) fn new(design: &Design, catalogue: &Catalogue) -> Self {
        let white =
            catalogue.features.par_iter().map(|feature| design.whiten_feature(feature, &design.fitted)).collect();
        Self::of(white, design.target(&design.fitted), design.fitted.clone())
    }

    fn of(white: Vec<White>, target: White, rows: Rows) -> Self {
        let count = white.len();
        let with_target = white.iter().map(|column| column.dot(&target, &rows)).collect();
        let products = (0..count * (count + 1) / 2).map(|_| AtomicU64::new(UNKNOWN)).collect();
        Self { white, target, rows, products, with_target }
    }

    /// Sum of products of two columns.
    pub(crate) fn product(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (a.max(b), a.min(b));
        let place = &self.products[a * (a + 1) / 2 + b];
        let known = place.load(Ordering::Relaxed);
        if known != UNKNOWN {
            return f64::from_bits(known);
        }
        // Two threads may both make it: they make the same.
        let product = self.white[a].dot(&self.white[b], &self.rows);
        place.store(product.to_bits(), Ordering::Relaxed);
        product
    }

    /// Sum of products of a column and the target.
    pub(crate) fn with_target(&self, column: usize) -> f64 {
        self.with_target[column]
    }
}

#[cfg(test)]
impl Columns {
    /// Of one joint.
    pub(crate) fn for_tests(columns: Vec<Vec<f64>>, target: Vec<f64>) -> Self {
        let white = |values| White { joint: Some(0), values };
        let rows = Rows { rows: Vec::new(), starts: vec![0, target.len()] };
        Self::of(columns.into_iter().map(white).collect(), white(target), rows)
    }
}
