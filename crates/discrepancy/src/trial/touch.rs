//! Whether tool and object touch in a row, as the sensor says and as simulated.

use physics_model::rig::RigReading;

use super::windows::least_force;
use super::{Course, Kind, Trial};

/// A row with a measured force on the tool. In the plane of the table, base axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Touch {
    /// As the log has it, s.
    pub(crate) time_secs: f64,
    /// The tool as simulated, m.
    pub(crate) tool_m: [f64; 2],
    /// Whether the measured force is one.
    pub(crate) measured: bool,
    /// Whether the simulated one is.
    pub(crate) simulated: bool,
    /// Square of measured less simulated force, beyond what the sensor's noise makes, N²; below 0 by chance.
    pub(crate) square_n2: f64,
}

impl Trial {
    /// Rows with a measured force; none without a tool, or a sensor at it.
    pub(crate) fn touches(&self, start: &RigReading, readings: &[RigReading]) -> Vec<Touch> {
        let course = Course { start, readings };
        let axis = |component| self.scalars.iter().find(|s| (s.kind, s.component) == (Kind::WristForce, component));
        let (Some(x), Some(y)) = (axis(0), axis(1)) else { return Vec::new() };
        let least_n = least_force(x.sigma, 1.0);
        (self.rows.iter().enumerate())
            .filter_map(|(row, at)| {
                let [tool_x, tool_y, _] = course.at(at.0).tool_m?;
                let measured = [x.values[row]?, y.values[row]?];
                let simulated = [x, y].map(|scalar| course.value(scalar.channel, *at));
                let less = (measured[0] - simulated[0]).hypot(measured[1] - simulated[1]);
                Some(Touch {
                    time_secs: self.time_secs[row],
                    tool_m: [tool_x, tool_y],
                    measured: measured[0].hypot(measured[1]) > least_n,
                    simulated: simulated[0].hypot(simulated[1]) > least_n,
                    square_n2: less * less - 2.0 * x.sigma * x.sigma,
                })
            })
            .collect()
    }
}
