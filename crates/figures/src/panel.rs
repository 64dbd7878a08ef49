//! What is drawn: plain data.

/// One chart with its title.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Above the chart; may be empty.
    pub title: String,
    /// What is drawn.
    pub chart: Chart,
}

/// The kinds of charts.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Chart {
    /// Values over a number: learning curves, likelihood per step.
    Lines(Lines),
    /// Counts per bin with the band in which they are expected: ranks.
    Histogram(Histogram),
    /// Values with intervals per category and series: success rates, coverage.
    Dots(Dots),
    /// A table of colours: confusion matrices.
    Heat(Heat),
    /// Shapes in the plane, to scale: a scene from above.
    Map(Map),
}

/// An axis with numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// The quantity with its unit, as in `time / s`.
    pub label: String,
    /// Lowest and highest value shown; from the data where `None`.
    pub limits: Option<(f64, f64)>,
    /// How values become distances.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis with limits from the data.
    #[must_use]
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }
}

/// How values become distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equally long.
    #[default]
    Linear,
    /// Equal factors are equally long; values that are not positive are gaps.
    Log,
}

/// A line or band at known values, in grey: a target, a chance level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// For the legend; empty for none.
    pub name: String,
    /// Lower end.
    pub low: f64,
    /// Upper end; equal to `low` for a line.
    pub high: f64,
}

/// Values over a number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// What is drawn, the last on top.
    pub series: Vec<Series>,
    /// Horizontal lines or bands.
    pub references: Vec<Reference>,
}

/// One line. A point with a number that is not finite interrupts it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// For the legend, and what the colour belongs to.
    pub name: String,
    /// (x, y) in the order of drawing.
    pub points: Vec<(f64, f64)>,
    /// (x, low, high) of a shaded band, ascending in x; may be empty.
    pub band: Vec<(f64, f64, f64)>,
    /// How the points are joined.
    pub stroke: Stroke,
    /// The series whose colour it shares; its own where empty.
    pub like: String,
}

/// How points are joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stroke {
    /// A line.
    #[default]
    Solid,
    /// A dashed line.
    Dashed,
    /// A line with a marker at each point.
    Marked,
    /// Markers alone.
    Markers,
}

/// Counts per bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Horizontal axis; its limits are ignored for `edges`.
    pub x: Axis,
    /// Vertical axis; from zero where it has no limits.
    pub y: Axis,
    /// For the legend, and what the colour belongs to.
    pub name: String,
    /// Bins of equal width from the left.
    pub counts: Vec<f64>,
    /// Left edge of the first bin and right edge of the last.
    pub edges: (f64, f64),
    /// Where the counts are expected; bins outside have another colour.
    pub expected: Option<Reference>,
}

/// Values with intervals per category, series side by side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dots {
    /// One row (or column) each, from the top (or left).
    pub categories: Vec<String>,
    /// Label of the axis of categories; may be empty.
    pub category_label: String,
    /// The axis of values.
    pub value: Axis,
    /// What is drawn in each category.
    pub series: Vec<Estimates>,
    /// Lines or bands across all categories.
    pub references: Vec<Reference>,
    /// Which way values grow.
    pub direction: Direction,
}

/// Which way values grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// To the right; categories are rows, with room for long names.
    #[default]
    Right,
    /// Upwards; categories are columns.
    Up,
}

/// The values of one series, one a category.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// For the legend, and what the colour belongs to.
    pub name: String,
    /// As many as categories.
    pub values: Vec<Estimate>,
    /// How they are drawn.
    pub mark: Mark,
    /// The series whose colour it shares; its own where empty.
    pub like: String,
}

/// How a value is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// A filled marker, its shape by series.
    #[default]
    Dot,
    /// An open marker: values of others, as published.
    Open,
    /// A bar from zero.
    Bar,
}

/// A value with an interval. What is not finite is not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Where the marker is.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimate {
    /// A value with its interval.
    #[must_use]
    pub fn within(value: f64, low: f64, high: f64) -> Self {
        Self { value, low, high }
    }

    /// A value without an interval.
    #[must_use]
    pub fn exact(value: f64) -> Self {
        Self { value, low: f64::NAN, high: f64::NAN }
    }

    /// Nothing.
    #[must_use]
    pub fn missing() -> Self {
        Self::exact(f64::NAN)
    }
}

/// A table of colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heat {
    /// Names of the rows from the top.
    pub rows: Vec<String>,
    /// Names of the columns from the left.
    pub columns: Vec<String>,
    /// What the rows are; may be empty.
    pub row_label: String,
    /// What the columns are; may be empty.
    pub column_label: String,
    /// `values[row][column]`; a cell that is not finite is hatched.
    pub values: Vec<Vec<f64>>,
    /// Values of the lightest and the darkest colour; from the data where `None`.
    pub limits: Option<(f64, f64)>,
    /// Digits after the point of the numbers in the cells. With `None`, or where numbers do not fit, a bar beside the
    /// cells explains the colours.
    pub digits: Option<usize>,
    /// What the values are, for that bar; may be empty.
    pub value_label: String,
}

/// Shapes in the plane, x to the right and y up, with one scale for both and no ticks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// (lowest, highest) x and y that are shown at least; around the shapes where `None`.
    pub limits: Option<((f64, f64), (f64, f64))>,
    /// What is drawn, the last on top.
    pub shapes: Vec<Outline>,
    /// Length of the bar that tells the scale, and its label (`10 cm`).
    pub scale_bar: Option<(f64, String)>,
}

/// A shape of a map. A point with a number that is not finite is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// For the legend, and what the colour belongs to; empty for neither.
    pub name: String,
    /// The name whose colour it shares; its own where empty.
    pub like: String,
    /// (x, y); an outline that closes repeats its first point.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub draw: Draw,
}

/// How a shape is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Draw {
    /// Filled, from 0 (not to be seen) to 1; several over each other are the darker.
    Area {
        /// Share of the colour.
        opacity: f64,
    },
    /// A line through the points.
    #[default]
    Line,
    /// A dashed line through the points.
    Dashed,
    /// A marker at each point.
    Markers,
}
