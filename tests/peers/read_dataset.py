"""Reads a dataset with pandas and with polars, as a user of `cargo xtask datagen` would, and checks that both see the same.

    python tests/peers/read_dataset.py runs/data/sawyer
"""

import json
import pathlib
import sys

import numpy
import pandas
import polars


def main(folder: pathlib.Path) -> None:
    info = json.loads((folder / "meta/info.json").read_text())
    schema = info["schema"]
    shards = [folder / shard["path"] for shard in info["shards"]]
    by_pandas = pandas.concat([pandas.read_parquet(shard) for shard in shards], ignore_index=True)
    by_polars = polars.concat([polars.read_parquet(shard) for shard in shards])
    assert len(by_pandas) == by_polars.height == info["rows"], (len(by_pandas), by_polars.height, info["rows"])
    assert list(by_pandas.columns) == by_polars.columns, (list(by_pandas.columns), by_polars.columns)
    for column in by_pandas.columns:
        first = by_pandas[column].to_numpy()
        second = by_polars[column].to_numpy()
        if column in schema:
            first = numpy.stack(first)
            assert first.shape[1] == len(schema[column]), (column, first.shape)
        assert numpy.array_equal(first, second), column
    assert by_pandas["episode"].nunique() == info["episodes"]
    touched = numpy.stack(by_pandas["events"].to_numpy())[:, schema["events"].index("obstacle_touched")]
    episodes = by_pandas["episode"][touched == 1].nunique()
    assert episodes == info["counts"]["obstacle_touched_episodes"], (episodes, info["counts"])
    print(f"{folder}: {len(by_pandas)} rows of {info['episodes']} episodes, the same in pandas and polars")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
