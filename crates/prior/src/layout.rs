//! The meaning of every number that enters and leaves the network.

use crate::Error;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What goes in and comes out, stored with the weights; a mismatch is refused with one sentence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// Arm, as scenarios name it.
    pub robot: String,
    /// Names of the observation columns.
    pub observation: Vec<String>,
    /// Names of the continuous targets.
    pub continuous: Vec<String>,
    /// How each continuous target is written.
    pub transforms: Vec<Transform>,
    /// Categorical targets.
    pub classes: Vec<ClassTarget>,
}

/// Transform of a continuous target before it is normalised. Densities are densities of the transformed values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transform {
    /// As it is.
    Identity,
    /// Its natural logarithm, for positive and skewed values such as a mass.
    Log,
    /// Its difference from this observation column of the same step. The network then corrects a measurement instead of
    /// recalling it.
    MinusObservation(usize),
}

impl Transform {
    /// `value` as the network learns it, given the observation of the same step.
    #[must_use]
    pub fn apply(self, value: f64, observation: &[f64]) -> f64 {
        match self {
            Self::Identity => value,
            Self::Log => value.ln(),
            Self::MinusObservation(column) => value - observation[column],
        }
    }

    /// Inverse of [`Self::apply`].
    #[must_use]
    pub fn invert(self, written: f64, observation: &[f64]) -> f64 {
        match self {
            Self::Identity => written,
            Self::Log => written.exp(),
            Self::MinusObservation(column) => written + observation[column],
        }
    }
}

/// A categorical target, such as the object's shape.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassTarget {
    /// Name.
    pub name: String,
    /// Names of its values, at most 255; a class is an index into them.
    pub labels: Vec<String>,
}

impl Layout {
    /// Continuous targets in original units, from transformed ones after `observation`.
    #[must_use]
    pub fn invert(&self, written: &[f64], observation: &[f64]) -> Vec<f64> {
        let each = written.iter().zip(&self.transforms);
        each.map(|(value, transform)| transform.invert(*value, observation)).collect()
    }

    /// Whether its parts belong together: a transform for each continuous target, of an observation that there is; otherwise the reason.
    pub(crate) fn problem(&self) -> Option<String> {
        let (transforms, targets) = (self.transforms.len(), self.continuous.len());
        if transforms != targets {
            return Some(format!("layout has {transforms} transforms for {targets} continuous targets"));
        }
        let columns = self.observation.len();
        self.transforms.iter().find_map(|transform| match transform {
            Transform::MinusObservation(column) if *column >= columns => {
                Some(format!("layout has a transform with observation {column}, expected one of 0 to {}", columns - 1))
            }
            _ => None,
        })
    }

    /// Refuses `self`, read from `path`, unless it equals `expected`.
    ///
    /// # Errors
    ///
    /// [`Error::Robot`] for another arm, else [`Error::Layout`] with the first difference.
    pub fn check(&self, expected: &Self, path: &Path) -> Result<(), Error> {
        if self.robot != expected.robot {
            let (found, expected) = (whole_file::one_line(&self.robot, 100), expected.robot.clone());
            return Err(Error::Robot { path: path.to_path_buf(), found, expected });
        }
        let transforms = |layout: &Self| layout.transforms.iter().map(|t| format!("{t:?}")).collect::<Vec<_>>();
        let describe = |targets: &[ClassTarget]| -> Vec<String> {
            targets.iter().map(|target| format!("{} [{}]", target.name, target.labels.join(", "))).collect()
        };
        let parts = [
            ("observation", self.observation.clone(), expected.observation.clone()),
            ("continuous target", self.continuous.clone(), expected.continuous.clone()),
            ("transform", transforms(self), transforms(expected)),
            ("class target", describe(&self.classes), describe(&expected.classes)),
        ];
        for (part, found, expected) in parts {
            if let Some(index) = (0..found.len().max(expected.len())).find(|&i| found.get(i) != expected.get(i)) {
                let quote = |names: &[String]| {
                    names.get(index).map_or("absent".into(), |name| format!("`{}`", whole_file::one_line(name, 200)))
                };
                let (found, expected) = (quote(&found), quote(&expected));
                return Err(Error::Layout { path: path.to_path_buf(), part, index, found, expected });
            }
        }
        Ok(())
    }
}

/// One episode as the network sees it: observations in original units, targets as the layout's transforms write them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sequence {
    /// Observations, `[steps, observation]`, row-major.
    pub observations: Vec<f32>,
    /// Continuous targets, `[steps, continuous]`, row-major; any value (NaN included) where the mask is 0.
    pub targets: Vec<f32>,
    /// 1 where a target applies, 0 where it does not, `[steps, continuous]`, row-major.
    pub mask: Vec<f32>,
    /// Index of the true label, `[steps, class targets]`, row-major.
    pub classes: Vec<u8>,
    /// Number of time steps.
    pub steps: usize,
}

impl Sequence {
    /// Every step as a sequence of its own.
    #[must_use]
    pub fn single_steps(&self) -> Vec<Self> {
        let row = |values: &[f32], step: usize| {
            let width = values.len() / self.steps;
            values[step * width..(step + 1) * width].to_vec()
        };
        let kinds = self.classes.len() / self.steps.max(1);
        let single = |step: usize| Self {
            observations: row(&self.observations, step),
            targets: row(&self.targets, step),
            mask: row(&self.mask, step),
            classes: self.classes[step * kinds..(step + 1) * kinds].to_vec(),
            steps: 1,
        };
        (0..self.steps).map(single).collect()
    }

    /// Checks sizes and values of sequence number `index` against `layout`.
    ///
    /// # Errors
    ///
    /// [`Error::Size`] or [`Error::Value`] with the first offending field.
    pub fn check(&self, layout: &Layout, index: usize) -> Result<(), Error> {
        let (inputs, outputs, kinds) = (layout.observation.len(), layout.continuous.len(), layout.classes.len());
        let sizes = [
            ("observations", self.observations.len(), self.steps * inputs),
            ("targets", self.targets.len(), self.steps * outputs),
            ("mask", self.mask.len(), self.steps * outputs),
            ("classes", self.classes.len(), self.steps * kinds),
            ("steps", self.steps, self.steps.max(1)),
        ];
        for (field, found, expected) in sizes {
            if found != expected {
                return Err(Error::Size { sequence: index, field, found, expected });
            }
        }
        let refuse = |position: usize, width: usize, name: &str, found: String, expected| {
            let (step, name) = (position / width, name.to_string());
            Err(Error::Value { sequence: index, step, name, found, expected })
        };
        if let Some(at) = self.observations.iter().position(|value| !value.is_finite()) {
            let name = &layout.observation[at % inputs];
            return refuse(at, inputs, name, self.observations[at].to_string(), "a finite number");
        }
        for (at, (&value, &mask)) in self.targets.iter().zip(&self.mask).enumerate() {
            if mask != 0.0 && mask != 1.0 {
                return refuse(at, outputs, &layout.continuous[at % outputs], format!("masked by {mask}"), "0 or 1");
            }
            if mask == 1.0 && !value.is_finite() {
                return refuse(at, outputs, &layout.continuous[at % outputs], value.to_string(), "a finite number");
            }
        }
        for (at, &class) in self.classes.iter().enumerate() {
            let target = &layout.classes[at % kinds];
            if usize::from(class) >= target.labels.len() {
                return refuse(at, kinds, &target.name, format!("class {class}"), "an index into the labels");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A layout of `inputs` observations, `outputs` continuous targets and one class target per entry of `kinds`.
    pub(crate) fn layout(inputs: usize, outputs: usize, kinds: &[usize]) -> Layout {
        let names = |prefix: &str, count: usize| (0..count).map(|i| format!("{prefix}_{i}")).collect::<Vec<_>>();
        let classes = kinds.iter().enumerate();
        let classes = classes.map(|(j, &n)| ClassTarget { name: format!("class_{j}"), labels: names("label", n) });
        Layout {
            robot: "sawyer".into(),
            observation: names("observation", inputs),
            continuous: names("target", outputs),
            transforms: vec![Transform::Identity; outputs],
            classes: classes.collect(),
        }
    }

    #[test]
    fn first_difference_between_layouts_is_named() {
        let ours = layout(2, 3, &[3]);
        let path = Path::new("p.json");
        assert!(ours.check(&ours, path).is_ok());
        let mut theirs = ours.clone();
        theirs.robot = "jaco".into();
        let message = ours.check(&theirs, path).unwrap_err().to_string();
        assert_eq!(message, "p.json: trained for the robot `sawyer`, but this problem uses `jaco`");
        let mut theirs = ours.clone();
        theirs.observation.push("extra".into());
        let message = ours.check(&theirs, path).unwrap_err().to_string();
        assert_eq!(message, "p.json: observation 2 is absent, but this problem has `extra`");
        let mut theirs = ours.clone();
        theirs.continuous.swap(0, 1);
        let message = ours.check(&theirs, path).unwrap_err().to_string();
        assert_eq!(message, "p.json: continuous target 0 is `target_0`, but this problem has `target_1`");
        let mut theirs = ours.clone();
        theirs.transforms[2] = Transform::MinusObservation(1);
        let message = ours.check(&theirs, path).unwrap_err().to_string();
        assert_eq!(message, "p.json: transform 2 is `Identity`, but this problem has `MinusObservation(1)`");
        let mut theirs = ours.clone();
        theirs.classes[0].labels.pop();
        let message = ours.check(&theirs, path).unwrap_err().to_string();
        assert!(message.starts_with("p.json: class target 0 is `class_0 [label_0, label_1, label_2]`"), "{message}");
    }

    #[test]
    fn a_transform_and_its_inverse_cancel() {
        let observation = [4.0, -0.25];
        for (transform, value, written) in [
            (Transform::Identity, 2.0, 2.0),
            (Transform::Log, std::f64::consts::E, 1.0),
            (Transform::MinusObservation(1), 0.5, 0.75),
        ] {
            assert_eq!(transform.apply(value, &observation), written);
            assert_eq!(transform.invert(written, &observation), value);
        }
    }

    #[test]
    fn bad_examples_are_refused_with_their_place() {
        let layout = layout(1, 2, &[3]);
        let good = Sequence {
            observations: vec![0.0; 2],
            targets: vec![1.0, f32::NAN, 1.0, 1.0],
            mask: vec![1.0, 0.0, 1.0, 1.0],
            classes: vec![0, 2],
            steps: 2,
        };
        assert!(good.check(&layout, 0).is_ok(), "a masked NaN does no harm");
        let check = |change: &dyn Fn(&mut Sequence)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.check(&layout, 7).unwrap_err().to_string()
        };
        assert_eq!(
            check(&|s| s.classes[1] = 3),
            "sequence 7, step 1: class_0 is class 3, expected an index into the labels"
        );
        assert_eq!(check(&|s| s.mask[1] = 1.0), "sequence 7, step 0: target_1 is NaN, expected a finite number");
        assert_eq!(check(&|s| s.mask[3] = 0.5), "sequence 7, step 1: target_1 is masked by 0.5, expected 0 or 1");
        assert_eq!(
            check(&|s| s.observations[1] = f32::INFINITY),
            "sequence 7, step 1: observation_0 is inf, expected a finite number"
        );
        assert_eq!(check(&|s| s.steps = 3), "sequence 7: observations holds 2 values, expected 3");
        let empty = Sequence::default().check(&layout, 0).unwrap_err().to_string();
        assert_eq!(empty, "sequence 0: steps holds 0 values, expected 1");
    }
}
