//! Parquet files, batch by batch.

use std::fs::File;
use std::path::Path;

use arrow_array::cast::AsArray as _;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, TimestampMicrosecondType,
    TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type,
    UInt64Type,
};
use arrow_array::{Array as _, ArrayRef};
use arrow_schema::{DataType, TimeUnit};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::Error;
use crate::mapping::Mapping;
use crate::plan::Plan;
use crate::rows::{Columns, ElementNames, Extractor, Place};
use crate::store::Store;
use crate::value::Value;

/// Rows that are decoded at once.
const BATCH_ROWS: usize = 2048;
/// Bytes that the columns of a mapping may take in a group of rows, unpacked.
const LARGEST_GROUP: u64 = 256 << 20;

/// Takes what a plan asks for from a Parquet file. `elements` names the elements of columns that hold lists.
pub(crate) fn read(
    mapping: &Mapping,
    plan: &Plan,
    path: &Path,
    file: File,
    elements: &ElementNames,
    store: &mut Store,
) -> Result<(), Error> {
    // parquet 60.1 panics on some damaged pages where it should return an error. That must not end the program.
    let attempt = std::panic::AssertUnwindSafe(|| read_trusting(mapping, plan, path, file, elements, store));
    whole_file::caught(attempt).unwrap_or_else(|| Err(broken(path, &"a page contradicts its header")))
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::broken(path, "Parquet", reason)
}

/// Names and types of the columns of a file.
pub(crate) fn columns(path: &Path, file: File) -> Result<Vec<(String, DataType)>, Error> {
    let attempt = || ParquetRecordBatchReaderBuilder::try_new(file);
    let builder = whole_file::caught(std::panic::AssertUnwindSafe(attempt))
        .ok_or_else(|| broken(path, &"its footer contradicts itself"))?
        .map_err(|e| broken(path, &e))?;
    Ok(builder.schema().fields().iter().map(|f| (f.name().clone(), f.data_type().clone())).collect())
}

fn read_trusting(
    mapping: &Mapping,
    plan: &Plan,
    path: &Path,
    file: File,
    elements: &ElementNames,
    store: &mut Store,
) -> Result<(), Error> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(|e| broken(path, &e))?;
    let names: Vec<String> = builder.schema().fields().iter().map(|field| field.name().clone()).collect();
    let single = |kind: &DataType| !kind.is_nested() && *kind != DataType::Null;
    let lists = builder.schema().fields().iter().map(|field| !single(field.data_type())).collect();
    let mut extractor = Extractor::new(mapping, plan, path, Columns { names, elements, lists })?;
    let used = extractor.columns();
    for column in &used {
        let field = &builder.schema().fields()[*column];
        if !known(field.data_type()) {
            let expected = "numbers, texts, times or lists of numbers";
            let place = format!("column {}", crate::error::excerpt(field.name()));
            return Err(Error::source(path, place, expected, field.data_type().to_string()));
        }
    }
    let mask = ProjectionMask::roots(builder.parquet_schema(), used.iter().copied());
    check_size(&builder, path, &mask)?;
    // Where a column of the file stands in a batch.
    let place = |column: usize| used.iter().position(|other| *other == column).unwrap_or(0);
    let reader = builder.with_projection(mask).with_batch_size(BATCH_ROWS).build().map_err(|e| broken(path, &e))?;
    for batch in reader {
        let batch = batch.map_err(|e| broken(path, &e))?;
        for row in 0..batch.num_rows() {
            extractor.row(store, &|at: Place| cell(batch.column(place(at.column)), row, at.element))?;
        }
    }
    Ok(())
}

/// Refuses what would not fit in bounded memory, before a page is read.
fn check_size(
    builder: &ParquetRecordBatchReaderBuilder<File>,
    path: &Path,
    mask: &ProjectionMask,
) -> Result<(), Error> {
    for group in builder.metadata().row_groups() {
        let taken = group.columns().iter().enumerate().filter(|(leaf, _)| mask.leaf_included(*leaf));
        let sizes = taken.map(|(_, column)| u64::try_from(column.uncompressed_size()).unwrap_or(u64::MAX));
        let found = sizes.fold(0, u64::saturating_add);
        if found > LARGEST_GROUP {
            let what = "bytes of a group of rows, unpacked";
            return Err(Error::TooLarge { path: path.to_owned(), what, limit: LARGEST_GROUP, found });
        }
    }
    Ok(())
}

fn known(kind: &DataType) -> bool {
    match kind {
        DataType::List(field) | DataType::LargeList(field) | DataType::FixedSizeList(field, _) => {
            !field.data_type().is_nested() && known(field.data_type())
        }
        DataType::Float32 | DataType::Float64 | DataType::Null | DataType::Boolean => true,
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Timestamp(_, _) => true,
        other => other.is_integer(),
    }
}

/// A cell, or an element of the list in it; its type was checked.
fn cell(array: &ArrayRef, row: usize, element: Option<usize>) -> Value {
    if array.is_null(row) {
        return Value::Missing;
    }
    let list = match array.data_type() {
        DataType::List(_) => array.as_list::<i32>().value(row),
        DataType::LargeList(_) => array.as_list::<i64>().value(row),
        DataType::FixedSizeList(_, _) => array.as_fixed_size_list().value(row),
        _ if element.is_some_and(|element| element > 0) => return Value::Missing,
        _ => return number(array, row),
    };
    match element {
        Some(element) if element < list.len() && !list.is_null(element) => number(&list, element),
        Some(_) => Value::Missing,
        // A list of one is that one, as some writers keep numbers.
        None if list.len() == 1 && !list.is_null(0) => number(&list, 0),
        None => Value::List(Vec::new()),
    }
}

fn number(array: &ArrayRef, i: usize) -> Value {
    macro_rules! whole {
        ($type:ty, $times:expr) => {
            Value::Whole(i128::from(array.as_primitive::<$type>().value(i)) * $times)
        };
    }
    let float = |value: f64| if value.is_nan() { Value::Missing } else { Value::Number(value) };
    match array.data_type() {
        DataType::Float32 => float(f64::from(array.as_primitive::<Float32Type>().value(i))),
        DataType::Float64 => float(array.as_primitive::<Float64Type>().value(i)),
        DataType::Int8 => whole!(Int8Type, 1),
        DataType::Int16 => whole!(Int16Type, 1),
        DataType::Int32 => whole!(Int32Type, 1),
        DataType::Int64 => whole!(Int64Type, 1),
        DataType::UInt8 => whole!(UInt8Type, 1),
        DataType::UInt16 => whole!(UInt16Type, 1),
        DataType::UInt32 => whole!(UInt32Type, 1),
        DataType::UInt64 => whole!(UInt64Type, 1),
        // Times of a calendar are whole nanoseconds.
        DataType::Timestamp(TimeUnit::Second, _) => whole!(TimestampSecondType, 1_000_000_000),
        DataType::Timestamp(TimeUnit::Millisecond, _) => whole!(TimestampMillisecondType, 1_000_000),
        DataType::Timestamp(TimeUnit::Microsecond, _) => whole!(TimestampMicrosecondType, 1000),
        DataType::Timestamp(TimeUnit::Nanosecond, _) => whole!(TimestampNanosecondType, 1),
        DataType::Boolean => Value::Whole(i128::from(array.as_boolean().value(i))),
        DataType::Utf8 => Value::Text(array.as_string::<i32>().value(i).into()),
        DataType::LargeUtf8 => Value::Text(array.as_string::<i64>().value(i).into()),
        // Of the types that pass, only one is left, and it holds nothing.
        _ => Value::Missing,
    }
}
