//! Columns to Parquet bytes, with a header in the metadata of the Arrow schema.

use std::sync::Arc;

use arrow_array::types::{ArrowPrimitiveType, Float32Type, Float64Type, Int8Type, UInt8Type, UInt32Type, UInt64Type};
use arrow_array::{Array, ArrayRef, FixedSizeListArray, PrimitiveArray, RecordBatch};
use arrow_schema::{Field, Metadata};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;
use serde::de::DeserializeOwned;

use crate::columns::Columns;
use crate::{Counts, Provenance, Schema, VERSION, seal};

/// Rows of a row group. Part of the bytes: changing it changes every file.
pub(crate) const GROUP_ROWS: usize = 64 * 1024;

/// What a shard says about itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Header {
    pub(crate) index: u32,
    pub(crate) schema: Schema,
    pub(crate) provenance: Provenance,
    pub(crate) counts: Counts,
    pub(crate) rows: u64,
    pub(crate) episodes: u64,
}

impl Header {
    fn to_metadata(&self) -> Metadata {
        let list = |names: &[String]| serde_json::Value::from(names).to_string();
        let counts = serde_json::to_string(&self.counts).expect("a map from text to numbers is JSON");
        Metadata::from([
            ("surmise.version", VERSION.to_string()),
            ("surmise.shard", self.index.to_string()),
            ("surmise.robot", self.schema.robot.clone()),
            ("surmise.observation", list(&self.schema.observation)),
            ("surmise.action_count", self.schema.action_count.to_string()),
            ("surmise.state", list(&self.schema.state)),
            ("surmise.theta", list(&self.schema.theta)),
            ("surmise.classes", list(&self.schema.classes)),
            ("surmise.events", list(&self.schema.events)),
            ("surmise.plan_hash", self.provenance.plan_hash.clone()),
            ("surmise.scenario_hash", self.provenance.scenario_hash.clone()),
            ("surmise.seed", self.provenance.seed.to_string()),
            ("surmise.commit", self.provenance.commit.clone()),
            ("surmise.counts", counts),
            ("surmise.rows", self.rows.to_string()),
            ("surmise.episodes", self.episodes.to_string()),
        ])
    }

    pub(crate) fn from_metadata(metadata: &Metadata) -> Result<Self, String> {
        let text = |key: &str| metadata.get(key).cloned().ok_or(format!("its metadata lacks the key `{key}`"));
        fn json<T: DeserializeOwned>(key: &str, text: Result<String, String>) -> Result<T, String> {
            serde_json::from_str(&text?)
                .map_err(|e| format!("its metadata key `{key}` is malformed: {}", whole_file::plain(&e.to_string())))
        }
        let version: u32 = json("surmise.version", text("surmise.version"))?;
        if version != VERSION {
            return Err(format!("it has version {version}, but this program reads version {VERSION}"));
        }
        let list = |key: &str| json::<Vec<String>>(key, text(key));
        let number = |key: &str| json::<u64>(key, text(key));
        let schema = Schema {
            robot: text("surmise.robot")?,
            observation: list("surmise.observation")?,
            action_count: json("surmise.action_count", text("surmise.action_count"))?,
            state: list("surmise.state")?,
            theta: list("surmise.theta")?,
            classes: list("surmise.classes")?,
            events: list("surmise.events")?,
        };
        let provenance = Provenance {
            plan_hash: text("surmise.plan_hash")?,
            scenario_hash: text("surmise.scenario_hash")?,
            seed: number("surmise.seed")?,
            commit: text("surmise.commit")?,
        };
        Ok(Self {
            index: json("surmise.shard", text("surmise.shard"))?,
            schema,
            provenance,
            counts: json("surmise.counts", text("surmise.counts"))?,
            rows: number("surmise.rows")?,
            episodes: number("surmise.episodes")?,
        })
    }
}

/// Parquet bytes: a function of the arguments alone.
pub(crate) fn encode(header: &Header, columns: &Columns) -> Result<Vec<u8>, ParquetError> {
    let mut fields = Vec::new();
    let mut arrays: Vec<ArrayRef> = Vec::new();
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_dictionary_enabled(false)
        .set_max_row_group_row_count(Some(GROUP_ROWS))
        .set_statistics_enabled(EnabledStatistics::None);

    macro_rules! scalar {
        ($name:literal, $type:ty, $values:expr, $encoding:expr) => {
            fields.push(Field::new($name, <$type>::DATA_TYPE, false));
            arrays.push(Arc::new(PrimitiveArray::<$type>::from($values.clone())));
            properties = properties.set_column_encoding(ColumnPath::from($name), $encoding);
        };
    }
    // A vector column without values is left out: Arrow cannot count the rows of an empty list.
    macro_rules! vector {
        ($name:literal, $type:ty, $values:expr, $width:expr, $encoding:expr) => {
            if $width > 0 {
                let item = Arc::new(Field::new("element", <$type>::DATA_TYPE, false));
                let width = i32::try_from($width).map_err(|e| ParquetError::General(e.to_string()))?;
                let values = Arc::new(PrimitiveArray::<$type>::from($values.clone()));
                let list = FixedSizeListArray::try_new(item, width, values, None)?;
                fields.push(Field::new($name, list.data_type().clone(), false));
                arrays.push(Arc::new(list));
                let path = ColumnPath::new(vec![$name.into(), "list".into(), "element".into()]);
                properties = properties.set_column_encoding(path, $encoding);
            }
        };
    }
    let schema = &header.schema;
    let (integer, float) = (Encoding::DELTA_BINARY_PACKED, Encoding::BYTE_STREAM_SPLIT);
    scalar!("episode", UInt64Type, columns.episode, integer);
    scalar!("step", UInt32Type, columns.step, integer);
    scalar!("action", Int8Type, columns.action, integer);
    scalar!("reward", Float32Type, columns.reward, float);
    scalar!("outcome", UInt8Type, columns.outcome, integer);
    vector!("observation", Float32Type, columns.observation, schema.observation.len(), float);
    vector!("state", Float64Type, columns.state, schema.state.len(), float);
    vector!("theta", Float64Type, columns.theta, schema.theta.len(), float);
    vector!("classes", UInt8Type, columns.classes, schema.classes.len(), integer);
    vector!("events", UInt8Type, columns.events, schema.events.len(), integer);

    let arrow = Arc::new(arrow_schema::Schema::new(fields).with_metadata(header.to_metadata()));
    let batch = RecordBatch::try_new(arrow.clone(), arrays)?;
    let mut writer = ArrowWriter::try_new(Vec::new(), arrow, Some(properties.build()))?;
    writer.write(&batch)?;
    Ok(seal::seal(writer.into_inner()?))
}

#[cfg(test)]
mod tests {
    use bytes::Bytes;
    use parquet::basic::Type;
    use parquet::file::reader::{FileReader, SerializedFileReader};

    use super::*;
    use crate::decode::decode;

    #[test]
    fn floats_are_split_by_byte_without_dictionary_and_all_is_compressed() {
        let name = |n: &str| vec![n.to_owned()];
        let header = Header {
            index: 3,
            schema: Schema {
                robot: "arm".into(),
                observation: name("torque_nm"),
                action_count: 10,
                state: name("x_m"),
                theta: name("mass_kg"),
                classes: name("shape"),
                events: name("tool_touched"),
            },
            provenance: Provenance {
                plan_hash: "p".into(),
                scenario_hash: "s".into(),
                seed: u64::MAX,
                commit: "c".into(),
            },
            counts: Counts::from([("diverged".into(), 2)]),
            rows: 1,
            episodes: 1,
        };
        let columns = Columns {
            episode: vec![u64::MAX],
            step: vec![0],
            action: vec![-1],
            reward: vec![0.5],
            outcome: vec![1],
            observation: vec![1.0],
            state: vec![2.0],
            theta: vec![3.0],
            classes: vec![255],
            events: vec![0],
        };
        let bytes = Bytes::from(encode(&header, &columns).unwrap());
        assert_eq!(decode(bytes.clone()).unwrap(), (header, columns));

        let reader = SerializedFileReader::new(bytes).unwrap();
        let mut floats = Vec::new();
        for column in reader.metadata().row_group(0).columns() {
            assert_eq!(column.dictionary_page_offset(), None);
            assert!(matches!(column.compression(), Compression::ZSTD(_)));
            if matches!(column.column_type(), Type::FLOAT | Type::DOUBLE) {
                assert!(column.encodings().any(|e| e == Encoding::BYTE_STREAM_SPLIT), "{}", column.column_path());
                floats.push(column.column_path().string());
            }
        }
        assert_eq!(floats, ["reward", "observation.list.element", "state.list.element", "theta.list.element"]);
    }
}
