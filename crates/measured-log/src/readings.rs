//! A column whose cells may be empty.

/// Finite values with gaps. No reading is NaN or infinite: a missing one is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Readings {
    // 9 bytes a cell instead of 16 for Option<f64>; 0 where nothing was read.
    values: Vec<f64>,
    present: Vec<bool>,
}

impl Readings {
    /// Number of cells, gaps included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether it has no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Reading of a row; `None` where it is missing or where there is no such row.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<f64> {
        (*self.present.get(row)?).then(|| self.values[row])
    }

    /// All cells.
    pub fn iter(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        self.values.iter().zip(&self.present).map(|(value, present)| present.then_some(*value))
    }

    /// Appends a cell.
    ///
    /// # Panics
    ///
    /// If the reading is NaN or infinite.
    pub fn push(&mut self, reading: Option<f64>) {
        assert!(reading.is_none_or(f64::is_finite), "reading {reading:?} is not finite");
        self.values.push(reading.unwrap_or(0.0));
        self.present.push(reading.is_some());
    }

    /// Number of cells with a reading.
    #[must_use]
    pub fn count(&self) -> usize {
        self.present.iter().filter(|p| **p).count()
    }

    /// Copy of some rows.
    pub(crate) fn slice(&self, rows: std::ops::Range<usize>) -> Self {
        Self { values: self.values[rows.clone()].to_vec(), present: self.present[rows].to_vec() }
    }
}

impl FromIterator<Option<f64>> for Readings {
    fn from_iter<I: IntoIterator<Item = Option<f64>>>(cells: I) -> Self {
        let mut readings = Self::default();
        for cell in cells {
            readings.push(cell);
        }
        readings
    }
}

impl FromIterator<f64> for Readings {
    fn from_iter<I: IntoIterator<Item = f64>>(cells: I) -> Self {
        cells.into_iter().map(Some).collect()
    }
}
