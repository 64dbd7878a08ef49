"""Models: the nominal model with the effects that were found."""

from __future__ import annotations

import os
from typing import Optional

from . import _surmise
from ._log import Log, Path
from ._progress import Progress, teller
from ._table import Table


class Model:
    """Content of a ``model.toml``: re-tuned values of the nominal model, and effects.

    From a diagnosis (``diagnosis.model``, ``diagnosis.nominal``) or :func:`read_model`.
    """

    def __init__(self, native: _surmise.Model) -> None:
        self._native = native

    @property
    def name(self) -> str:
        """What a report that begins with it calls it: its file."""
        return self._native.name

    @property
    def effects(self) -> list[str]:
        """Names of its effects in the catalogue."""
        return self._native.effects()

    @property
    def toml(self) -> str:
        """Text of ``model.toml``."""
        return self._native.toml()

    def simulate(
        self, log: Log, robot: Optional[Path] = None, threads: int = 0, progress: Progress = None
    ) -> Table:
        """Runs the episodes of a log with its commands, each freely from its first pose of the object.

        Gives a :class:`Table` with one row a row of the log: ``episode``, ``piece``, ``time_secs`` (s); and for ``measured`` and
        ``simulated`` each ``…_object_x_m`` (m), ``…_object_qx`` (quaternion x, y, z, w, body to base), and ``…_tool_x_m`` (m) where
        there is a tool. Rows before the first pose are left out. What is thrown is simulated in pieces of 0.15 s that each begin where
        the object was measured to be: the last row of one may be the first of the next. Velocities and forces are not given.

        ``robot``, ``threads``, ``progress``: as for :func:`diagnose`.
        """
        told, end = teller(progress)
        try:
            folder = None if robot is None else os.fspath(robot)
            return Table(self._native.simulate(log._native, folder, threads, told))
        finally:
            end()

    def __repr__(self) -> str:
        return f"<surmise.Model {self.name}: {', '.join(self.effects) or 'no effect'}>"


def read_model(path: Path) -> Model:
    """Reads a ``model.toml``, as a diagnosis writes it. Raises :class:`LogError` with the key and what was expected."""
    return Model(_surmise.Model.read(os.fspath(path)))
