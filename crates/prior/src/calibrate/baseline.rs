//! What is known without any observation: the distribution that the training worlds are drawn from.

use serde::{Deserialize, Serialize};

use crate::fused::{HALF_LOG_TAU, LOG_STDDEV_LIMITS};
use crate::normalise::{Normalisation, Scale};
use crate::{Layout, Sequence};

/// Fewest rows that give the spread of a structure. Below that the marginal over all structures is used.
const ENOUGH_ROWS: f64 = 30.0;

/// The sampling distribution as the training data show it: frequencies of the structures (joint labels of all class targets) and,
/// given the structure, independent Gaussians of the continuous targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baseline {
    /// Number of labels of each class target; a structure's index has the last target's label as its lowest digit.
    pub labels: Vec<usize>,
    /// Frequency of each structure.
    pub structures: Vec<f64>,
    /// Gaussian of each continuous target where it applies, `[structures][continuous]`.
    pub continuous: Vec<Vec<Scale>>,
}

impl Baseline {
    /// Fitted on `sequences`; the spread of a constant has the same floor as the network's, frequencies start from one count.
    #[must_use]
    pub fn fit(layout: &Layout, normalisation: &Normalisation, sequences: &[&Sequence]) -> Self {
        let (width, kinds) = (layout.continuous.len(), layout.classes.len());
        let labels: Vec<usize> = layout.classes.iter().map(|target| target.labels.len()).collect();
        let structures = labels.iter().product();
        // Count, mean and sum of squares of each structure's columns, by Welford's recurrence.
        let mut moments = vec![vec![(0.0, 0.0, 0.0); width]; structures];
        let mut counts = vec![1.0; structures];
        for sequence in sequences {
            for step in 0..sequence.steps {
                let structure = index(&labels, &sequence.classes[step * kinds..(step + 1) * kinds]);
                counts[structure] += 1.0;
                let rows = step * width..(step + 1) * width;
                let values = sequence.mask[rows.clone()].iter().zip(&sequence.targets[rows]);
                for ((count, mean, squares), (mask, value)) in moments[structure].iter_mut().zip(values) {
                    if *mask == 1.0 {
                        let value = f64::from(*value);
                        *count += 1.0;
                        let delta = value - *mean;
                        *mean += delta / *count;
                        *squares += delta * (value - *mean);
                    }
                }
            }
        }
        let scale = |(count, mean, squares): (f64, f64, f64), all: &Scale| {
            if count < ENOUGH_ROWS {
                return *all;
            }
            Scale { mean, stddev: f64::sqrt(squares / count).max(all.stddev * LOG_STDDEV_LIMITS.0.exp()) }
        };
        let total: f64 = counts.iter().sum();
        let continuous = moments.into_iter().map(|columns| {
            columns.into_iter().zip(&normalisation.continuous).map(|(moments, all)| scale(moments, all)).collect()
        });
        Self {
            continuous: continuous.collect(),
            structures: counts.iter().map(|count| count / total).collect(),
            labels,
        }
    }

    /// Whether it belongs to `layout` and has densities; otherwise the reason why not.
    pub(crate) fn check(&self, layout: &Layout) -> Result<(), String> {
        let labels: Vec<usize> = layout.classes.iter().map(|target| target.labels.len()).collect();
        // None where there are more than could ever be listed.
        let structures = labels.iter().try_fold(1_usize, |product, count| product.checked_mul(*count)).unwrap_or(0);
        let shape = (self.labels == labels, self.structures.len(), self.continuous.len());
        if shape != (true, structures, structures) || self.continuous.iter().any(|c| c.len() != layout.continuous.len())
        {
            return Err(format!("baseline does not have the {structures} structures and the targets of the layout"));
        }
        if !self.structures.iter().all(|share| *share > 0.0 && *share <= 1.0)
            || !self.continuous.iter().flatten().all(Scale::is_usable)
        {
            return Err("baseline holds a share outside (0, 1] or a scale without a finite spread above 0".into());
        }
        Ok(())
    }

    /// ln p(values, classes); values whose mask is false do not count.
    #[must_use]
    pub fn log_density(&self, values: &[f64], mask: &[bool], classes: &[u8]) -> f64 {
        let structure = index(&self.labels, classes);
        let gaussians = values.iter().zip(mask).zip(&self.continuous[structure]).filter(|((_, applies), _)| **applies);
        let gaussians = gaussians.map(|((value, _), scale)| {
            let standard = (value - scale.mean) / scale.stddev;
            -0.5 * standard * standard - scale.stddev.ln() - HALF_LOG_TAU
        });
        gaussians.sum::<f64>() + self.structures[structure].ln()
    }
}

/// Index of a structure.
fn index(labels: &[usize], classes: &[u8]) -> usize {
    labels.iter().zip(classes).fold(0, |index, (count, &class)| index * count + usize::from(class))
}
