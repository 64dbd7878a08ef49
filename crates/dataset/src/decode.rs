//! Parquet bytes to header and columns. Any bytes give columns or an error.

use arrow_array::cast::AsArray;
use arrow_array::types::{ArrowPrimitiveType, Float32Type, Float64Type, Int8Type, UInt8Type, UInt32Type, UInt64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::DataType;
use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::errors::ParquetError;

use crate::columns::Columns;
use crate::encode::{GROUP_ROWS, Header};
use crate::publish::one_line;
use crate::seal;

/// Bytes of a shard's columns at most: what a footer claims beyond that is no shard of ours.
const MOST_UNPACKED_BYTES: u64 = 16 << 30;

/// Header and columns of sealed Parquet bytes; otherwise the reason why not, on one line.
pub(crate) fn decode(bytes: Bytes) -> Result<(Header, Columns), String> {
    seal::check(&bytes)?;
    // parquet 60.1 panics on some contradictions where it should return an error. The seal keeps damage from it, not a file that was made so.
    let result = whole_file::caught(|| decode_sealed(bytes));
    let result = result.unwrap_or_else(|| Err("it cannot be decoded: it contradicts itself".into()));
    result.map_err(|reason| one_line(&reason, 400))
}

fn decode_sealed(bytes: Bytes) -> Result<(Header, Columns), String> {
    let unreadable = |e: ParquetError| format!("it cannot be decoded: {e}");
    let builder = ParquetRecordBatchReaderBuilder::try_new(bytes).map_err(unreadable)?;
    let header = Header::from_metadata(builder.schema().metadata())?;
    header.schema.check().map_err(|e| e.to_string())?;
    let groups = builder.metadata().row_groups().iter();
    let sizes = groups
        .flat_map(parquet::file::metadata::RowGroupMetaData::columns)
        .map(|c| u64::try_from(c.uncompressed_size()).unwrap_or(u64::MAX));
    let unpacked = sizes.fold(0, u64::saturating_add);
    if unpacked > MOST_UNPACKED_BYTES {
        return Err(format!("expected at most {MOST_UNPACKED_BYTES} bytes unpacked, found {unpacked}"));
    }
    let mut columns = Columns::default();
    let lists = header.schema.lists().map(|(_, names)| names.len());
    for batch in builder.with_batch_size(GROUP_ROWS).build().map_err(unreadable)? {
        let batch = batch.map_err(|e| unreadable(e.into()))?;
        scalar::<UInt64Type>(&batch, "episode", &mut columns.episode)?;
        scalar::<UInt32Type>(&batch, "step", &mut columns.step)?;
        scalar::<Int8Type>(&batch, "action", &mut columns.action)?;
        scalar::<Float32Type>(&batch, "reward", &mut columns.reward)?;
        scalar::<UInt8Type>(&batch, "outcome", &mut columns.outcome)?;
        vector::<Float32Type>(&batch, "observation", lists[0], &mut columns.observation)?;
        vector::<Float64Type>(&batch, "state", lists[1], &mut columns.state)?;
        vector::<Float64Type>(&batch, "theta", lists[2], &mut columns.theta)?;
        vector::<UInt8Type>(&batch, "classes", lists[3], &mut columns.classes)?;
        vector::<UInt8Type>(&batch, "events", lists[4], &mut columns.events)?;
    }
    if columns.rows() as u64 != header.rows {
        return Err(format!("expected {} rows, found {}", header.rows, columns.rows()));
    }
    columns.check(&header.schema).map_err(|e| e.to_string())?;
    let episodes = columns.episodes().len();
    if episodes as u64 != header.episodes {
        return Err(format!("expected {} episodes, found {episodes}", header.episodes));
    }
    Ok((header, columns))
}

fn column<'a>(batch: &'a RecordBatch, name: &str) -> Result<&'a ArrayRef, String> {
    batch.column_by_name(name).ok_or(format!("it lacks the column `{name}`"))
}

fn wrong_type(name: &str, expected: &str, found: &DataType) -> String {
    format!("column `{name}`: expected {expected}, found {found}")
}

fn scalar<T: ArrowPrimitiveType>(batch: &RecordBatch, name: &str, to: &mut Vec<T::Native>) -> Result<(), String> {
    let array = column(batch, name)?;
    let values = array
        .as_primitive_opt::<T>()
        .filter(|values| values.null_count() == 0)
        .ok_or_else(|| wrong_type(name, &T::DATA_TYPE.to_string(), array.data_type()))?;
    to.extend_from_slice(values.values());
    Ok(())
}

fn vector<T: ArrowPrimitiveType>(
    batch: &RecordBatch,
    name: &str,
    width: usize,
    to: &mut Vec<T::Native>,
) -> Result<(), String> {
    if width == 0 {
        return Ok(());
    }
    let array = column(batch, name)?;
    let values = array
        .as_fixed_size_list_opt()
        .filter(|list| usize::try_from(list.value_length()) == Ok(width))
        .filter(|list| list.null_count() == 0)
        .and_then(|list| list.values().as_primitive_opt::<T>())
        .filter(|values| values.null_count() == 0 && values.len() == width * batch.num_rows())
        .ok_or_else(|| wrong_type(name, &format!("lists of {width} {}", T::DATA_TYPE), array.data_type()))?;
    to.extend_from_slice(values.values());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::encode;
    use crate::{Counts, Provenance, Row, Schema};

    fn header(rows: u64, episodes: u64) -> Header {
        let name = |n: &str| vec![n.to_owned()];
        Header {
            index: 0,
            schema: Schema {
                robot: "arm".into(),
                observation: name("torque_nm"),
                action_count: 10,
                state: name("x_m"),
                theta: name("mass_kg"),
                classes: name("shape"),
                events: name("tool_touched"),
            },
            provenance: Provenance { plan_hash: "p".into(), scenario_hash: "s".into(), seed: 1, commit: "c".into() },
            counts: Counts::new(),
            rows,
            episodes,
        }
    }

    fn columns(state: f64) -> Columns {
        let row = |step| Row {
            episode: 7,
            step,
            action: if step == 0 { -1 } else { 3 },
            reward: 0.0,
            outcome: u8::from(step == 1),
            observation: vec![1.0],
            state: vec![2.0],
            theta: vec![0.5],
            classes: vec![1],
            events: vec![0],
        };
        let columns = Columns::from_rows(&header(2, 1).schema, &[row(0), row(1)]).unwrap();
        Columns { state: vec![2.0, state], ..columns }
    }

    #[test]
    fn what_a_writer_would_refuse_is_refused_behind_a_good_seal() {
        let read = |header: &Header, columns: &Columns| decode(encode(header, columns).unwrap().into());
        assert!(read(&header(2, 1), &columns(3.0)).is_ok());
        let cases = [
            (header(2, 1), columns(f64::NAN), "`x_m`: expected a finite value"),
            (header(3, 1), columns(3.0), "expected 3 rows, found 2"),
            (header(2, 5), columns(3.0), "expected 5 episodes, found 1"),
        ];
        for (header, columns, expected) in cases {
            let reason = read(&header, &columns).unwrap_err();
            assert!(reason.contains(expected), "{reason}");
        }
    }

    #[test]
    fn no_byte_behind_a_good_seal_ends_the_program() {
        let whole = encode(&header(2, 1), &columns(3.0)).unwrap();
        let footer = seal::footer_start(&whole).unwrap();
        let parquet = [&whole[..footer - seal::SEAL_LEN], &whole[footer..]].concat();
        for at in 0..parquet.len() {
            for byte in [0, 0x7f, 0x80, 0xff, parquet[at] ^ 1] {
                let mut bytes = parquet.clone();
                bytes[at] = byte;
                if seal::footer_start(&bytes).is_none() {
                    continue;
                }
                match decode(seal::seal(bytes).into()) {
                    Ok((header, columns)) => columns.check(&header.schema).unwrap(),
                    Err(reason) => assert!(!reason.is_empty() && !reason.contains(char::is_control), "{reason:?}"),
                }
            }
        }
    }
}
