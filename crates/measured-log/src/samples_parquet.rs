//! `samples.parquet`.

use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, UInt8Array, UInt64Array};
use arrow_schema::{DataType, Field, Schema};
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;

use crate::columns::{Cell, Columns, Role};
use crate::error::Problem;
use crate::{Episode, MAX_FILE_BYTES, MAX_ROWS, Readings, Robot};

/// Rows that are decoded at once.
const BATCH_ROWS: usize = 8192;

/// Why no rows could be read.
#[derive(Debug)]
pub(crate) enum Failure {
    Parquet(String),
    Problem(Problem),
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        Self::Problem(problem)
    }
}

/// Reads all rows.
pub(crate) fn decode(bytes: Bytes, robot: Robot) -> Result<Vec<Episode>, Failure> {
    // parquet 60.1 panics on some damaged pages where it should return an error, for example if a dictionary page is
    // missing. That must not end the program.
    let result = whole_file::caught(|| decode_trusting(bytes, robot));
    result.unwrap_or_else(|| Err(Failure::Parquet("a page contradicts its header".into())))
}

fn decode_trusting(bytes: Bytes, robot: Robot) -> Result<Vec<Episode>, Failure> {
    let unreadable = |e: ParquetError| Failure::Parquet(whole_file::one_line(&whole_file::plain(&e.to_string()), 300));
    let builder = ParquetRecordBatchReaderBuilder::try_new(bytes).map_err(unreadable)?;
    let schema = builder.schema().clone();
    let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
    let roles = Role::of(&names, robot)?;
    check_size(&builder)?;
    for (field, role) in schema.fields().iter().zip(&roles) {
        let known = field.data_type().is_integer()
            || matches!(field.data_type(), DataType::Float32 | DataType::Float64 | DataType::Null);
        if !known {
            let reason = format!("expected integers or 32- or 64-bit floats, found {}", field.data_type());
            return Err(Problem::column(role.name(), reason).into());
        }
    }
    let mut columns = Columns::new(&roles);
    let mut row = 0;
    for batch in builder.with_batch_size(BATCH_ROWS).build().map_err(unreadable)? {
        let batch = batch.map_err(|e| unreadable(e.into()))?;
        for (role, array) in roles.iter().zip(batch.columns()) {
            for i in 0..array.len() {
                columns.push(*role, row + i, cell(array, i))?;
            }
        }
        row += batch.num_rows();
    }
    Ok(columns.into_episodes())
}

/// Refuses what would not fit in bounded memory, before a page is read.
fn check_size<T>(builder: &parquet::arrow::arrow_reader::ArrowReaderBuilder<T>) -> Result<(), Failure> {
    let file = builder.metadata();
    let rows = usize::try_from(file.file_metadata().num_rows()).unwrap_or(usize::MAX);
    if rows > MAX_ROWS {
        return Err(Problem::Rows { found: rows }.into());
    }
    let mut unpacked = 0_u64;
    for group in file.row_groups() {
        for column in group.columns() {
            unpacked = unpacked.saturating_add(u64::try_from(column.uncompressed_size()).unwrap_or(u64::MAX));
        }
    }
    if unpacked > MAX_FILE_BYTES {
        return Err(Failure::Parquet(format!("expected at most {MAX_FILE_BYTES} bytes unpacked, found {unpacked}")));
    }
    Ok(())
}

/// Cell `i` of a column; its type was checked.
fn cell(array: &ArrayRef, i: usize) -> Cell<'static> {
    if array.is_null(i) {
        return Cell::Missing;
    }
    macro_rules! integer {
        ($type:ty) => {
            Cell::Integer(i128::from(array.as_primitive::<$type>().value(i)))
        };
    }
    match array.data_type() {
        DataType::Float32 => Cell::Float(f64::from(array.as_primitive::<Float32Type>().value(i))),
        DataType::Float64 => Cell::Float(array.as_primitive::<Float64Type>().value(i)),
        DataType::Int8 => integer!(Int8Type),
        DataType::Int16 => integer!(Int16Type),
        DataType::Int32 => integer!(Int32Type),
        DataType::Int64 => integer!(Int64Type),
        DataType::UInt8 => integer!(UInt8Type),
        DataType::UInt16 => integer!(UInt16Type),
        DataType::UInt32 => integer!(UInt32Type),
        DataType::UInt64 => integer!(UInt64Type),
        // Of the types that pass, only one is left, and it holds nothing.
        _ => Cell::Missing,
    }
}

/// Parquet bytes of valid episodes: a function of them alone.
pub(crate) fn encode(episodes: &[Episode]) -> Result<Vec<u8>, ParquetError> {
    let rows = || episodes.iter().flat_map(|e| (0..e.rows()).map(move |row| (e, row)));
    let mut fields = vec![
        Field::new(Role::Episode.name(), DataType::UInt64, false),
        Field::new(Role::Time.name(), DataType::Float64, false),
    ];
    let mut arrays: Vec<ArrayRef> = vec![
        Arc::new(UInt64Array::from_iter_values(rows().map(|(e, _)| e.id))),
        Arc::new(Float64Array::from_iter_values(rows().map(|(e, row)| e.time_secs[row]))),
    ];
    if let Some(first) = episodes.first() {
        if first.action.is_some() {
            let actions = rows().map(|(e, row)| e.action.as_ref().and_then(|a| a[row]));
            fields.push(Field::new(Role::Action.name(), DataType::UInt8, true));
            arrays.push(Arc::new(actions.collect::<UInt8Array>()));
        }
        for channel in first.channels.keys() {
            let empty = Readings::default();
            let readings = episodes.iter().flat_map(|e| e.channels.get(channel).unwrap_or(&empty).iter());
            fields.push(Field::new(channel.name(), DataType::Float64, true));
            arrays.push(Arc::new(readings.collect::<Float64Array>()));
        }
    }
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(schema.clone(), arrays)?;
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?));
    let mut writer = ArrowWriter::try_new(Vec::new(), schema, Some(properties.build()))?;
    writer.write(&batch)?;
    writer.into_inner()
}
