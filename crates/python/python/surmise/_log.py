"""Logs: what a robot did, tick by tick."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Union

from . import _surmise
from ._table import Table, columns_of

if TYPE_CHECKING:
    import pandas

Path = Union[str, "os.PathLike[str]"]


class Log:
    """A log that was read and checked: what was commanded and measured, and the nominal model of rig and object.

    Made by :func:`read_log` or :meth:`from_pandas`. ``docs/src/reference/measured-log.md`` has all columns and keys.
    """

    def __init__(self, native: _surmise.Log) -> None:
        self._native = native

    @classmethod
    def from_pandas(cls, frame: Any, header: Mapping[str, Any] | str, name: str = "log") -> Log:
        """A log of a frame in memory.

        ``frame``: a frame of pandas, polars or Arrow, or a mapping of names to arrays of shape ``[rows]``. One row a tick, ordered by
        ``episode`` and ``time_secs`` (s). The names are those of ``samples.csv`` and end in their units: ``object_x_m`` (m),
        ``object_qx`` … ``object_qw`` (unit quaternion, body to base), ``wrist_fx_n`` (N) and so on. NaN or nothing: not measured.

        ``header``: the keys of ``log.toml`` as nested mappings, or its text. A number is exact, or ``{"mean": m, "stddev": s}``.

        ``name``: what the report calls the log.

        Raises :class:`LogError` with row and column, or key, and what was expected.
        """
        is_json = not isinstance(header, str)
        if is_json and not isinstance(header, Mapping):
            raise TypeError(f"header: expected a mapping or the text of log.toml, found {type(header).__name__}")
        text = json.dumps(header, default=_plain) if is_json else header
        return cls(_surmise.Log.of_columns(columns_of(frame), text, is_json, name))

    @property
    def name(self) -> str:
        """What a report calls it: its folder as it was given."""
        return self._native.name

    @property
    def header(self) -> str:
        """The nominal model of rig and object: text of ``log.toml``, which :meth:`from_pandas` takes."""
        return self._native.header()

    @property
    def episodes(self) -> list[int]:
        """Numbers of the episodes."""
        return self._native.episodes()

    def columns(self) -> Table:
        """All columns by name, float64 of shape ``[rows]``, NaN where nothing was read."""
        return Table(self._native.columns())

    def to_pandas(self) -> pandas.DataFrame:
        """The same as a frame of pandas; :meth:`from_pandas` makes the same log of it."""
        return self.columns().to_pandas()

    def check(self, robot: Path | None = None) -> dict[str, Any]:
        """What its own readings say against its units, frames, sizes and sensors, as ``cargo xtask log check --json`` does.

        ``suspicions`` lists what looks wrong: ``kind``, ``found``, ``mend``; it is empty where nothing does. ``not_told`` says what this log cannot
        show, ``sensors`` what each reads. ``robot``: the project folder, for logs of an arm.
        """
        return json.loads(self._native.check(None if robot is None else os.fspath(robot)))

    def save(self, folder: Path, format: str = "csv") -> None:
        """Writes ``log.toml`` and ``samples.csv`` (or ``format="parquet"``) into a folder that holds no log yet."""
        if format not in ("csv", "parquet"):
            raise ValueError(f"format: expected csv or parquet, found {format!r}")
        self._native.save(os.fspath(folder), format == "parquet")

    def __repr__(self) -> str:
        return f"<surmise.Log {self.name}: {len(self.episodes)} episodes>"


def read_log(path: Path) -> Log:
    """Reads and checks the log in the folder ``path``: ``log.toml`` with ``samples.csv`` or ``samples.parquet``.

    Raises :class:`LogError` with file, row and column, or key, and what was expected.
    """
    return Log(_surmise.Log.read(os.fspath(path)))


def _plain(value: Any) -> Any:
    """Numbers and arrays of NumPy as those of Python."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"header: expected numbers, texts, lists and mappings, found a {type(value).__name__}")
