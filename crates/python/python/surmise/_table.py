"""Columns of numbers, in and out."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ._surmise import LogError

if TYPE_CHECKING:
    import pandas

#: Columns of whole numbers: they have no gaps.
_WHOLE = ("episode", "piece")


class Table(Mapping[str, memoryview]):
    """Columns by name, each a buffer of 64-bit floats of shape ``[rows]``, NaN where nothing was read.

    ``numpy.asarray(table["time_secs"])`` is an array without a copy. The unit is the end of the name.
    """

    def __init__(self, columns: list[tuple[str, bytes]]) -> None:
        self._columns = {name: memoryview(cells).cast("d") for name, cells in columns}

    def __getitem__(self, name: str) -> memoryview:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Number of columns."""
        return len(self._columns)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def to_pandas(self) -> pandas.DataFrame:
        """As a frame of pandas, one row a row; needs pandas."""
        import numpy
        import pandas

        frame = pandas.DataFrame({name: numpy.array(cells) for name, cells in self._columns.items()})
        return frame.astype({name: "int64" for name in _WHOLE if name in frame})

    def __repr__(self) -> str:
        return f"<surmise.Table of {self.rows} rows: {', '.join(self._columns)}>"


def columns_of(frame: Any) -> list[tuple[str, bytes]]:
    """Names and bytes of the columns of a frame: of pandas, polars or Arrow, or a mapping of arrays or lists."""
    names = getattr(frame, "column_names", None)
    if names is None:
        names = frame.columns if hasattr(frame, "columns") else frame.keys()
    return [(str(name), _cells(str(name), frame[name])) for name in names]


def _cells(name: str, column: Any) -> bytes:
    """Cells as 64-bit floats: a missing one becomes NaN."""
    try:
        if hasattr(column, "to_numpy") or hasattr(column, "__array__"):
            return _array(column)
        return array("d", [float("nan") if cell is None else cell for cell in column]).tobytes()
    except (TypeError, ValueError) as error:
        raise LogError(f"column `{name}`: expected numbers or nothing, found {_kind(column)}") from error


def _array(column: Any) -> bytes:
    import numpy

    if isinstance(getattr(column, "dtype", None), numpy.dtype):
        if column.dtype.kind not in "iufOb":
            raise TypeError(column.dtype)
        cells = numpy.asarray(column, dtype="float64")
    elif hasattr(column, "iloc"):
        # Types of pandas that have a mark of their own for what is missing.
        cells = column.to_numpy(dtype="float64", na_value=float("nan"))
    else:
        cells = column.to_numpy()
        if cells.dtype.kind not in "iuf":
            raise TypeError(cells.dtype)
        cells = cells.astype("float64")
    if cells.ndim != 1:
        raise ValueError(cells.shape)
    return numpy.ascontiguousarray(cells).tobytes()


def _kind(column: Any) -> str:
    kind = getattr(column, "dtype", None) or getattr(column, "type", None)
    return str(kind) if kind is not None else f"a {type(column).__name__} with other things"
