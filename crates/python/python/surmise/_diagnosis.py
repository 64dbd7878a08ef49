"""Diagnoses: what the nominal model of a log lacks."""

from __future__ import annotations

import html
import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional, Union

from . import _surmise
from ._log import Log, Path
from ._model import Model, read_model
from ._progress import Progress, teller

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class Parameter:
    """A fitted value of an effect, in ``unit``, with its 90 % interval."""

    name: str
    key: str
    unit: str
    value: float
    interval90: tuple[float, float]


@dataclass(frozen=True)
class Effect:
    """A named effect. ``confidence``: probability that the name is right. ``log_evidence``: gain in ln evidence over the model without it."""

    name: str
    description: str
    confidence: float
    log_evidence: float
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class Cell:
    """Where simulation and measurement disagree: a channel in a phase. ``share``: of all that is beyond noise. ``mean_square``: 1 is noise.
    ``p_value``: chance that some cell would stand out as much although nothing is wrong."""

    channel: str
    phase: str
    share: float
    mean_square: float
    p_value: float


@dataclass(frozen=True)
class Heldout:
    """Mean square of the residuals of episodes to which nothing was fitted, in variances of the sensors: noise alone gives ``noise_floor``."""

    before: float
    after: float
    noise_floor: float
    closed_fraction: float


class Diagnosis:
    """The answer to a log. In a notebook it shows the report page."""

    def __init__(self, native: _surmise.Diagnosis, log: Log, robot: Optional[Path]) -> None:
        self._native = native
        self._log = log
        self._robot = robot
        #: Content of ``report.json``; ``docs/src/reference/files.md`` says what each key means.
        self.report: dict[str, Any] = json.loads(native.json())

    @property
    def verdict(self) -> str:
        """``"effect"``, ``"none"`` or ``"unknown"``."""
        return self.report["verdict"]

    @property
    def summary(self) -> str:
        """The answer in a sentence or two."""
        return self.report["summary"]

    @property
    def effects(self) -> list[Effect]:
        """Named effects, in the order in which they were accepted."""
        return [_effect(effect) for effect in self.report["effects"]]

    @property
    def confusion_set(self) -> list[str]:
        """Names that this log does not tell apart, the most probable first."""
        return list(self.report["confusion_set"])

    @property
    def located(self) -> list[Cell]:
        """Where the re-tuned nominal model disagrees, the largest share first."""
        keys = Cell.__dataclass_fields__
        return [Cell(**{key: cell[key] for key in keys}) for cell in self.report["located"]]

    @property
    def heldout(self) -> Heldout:
        """Error on held-out episodes, before and after."""
        return Heldout(**{key: self.report["heldout"][key] for key in Heldout.__dataclass_fields__})

    @property
    def warnings(self) -> list[str]:
        """What the log's own readings say against it, and what against the answer: to be read first."""
        return [warning["sentence"] for warning in self.report["warnings"]]

    @property
    def next_experiment(self) -> str:
        """What to record next."""
        return self.report["next_experiment"]

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return self.report["seconds"]

    @property
    def model(self) -> Model:
        """The nominal model, re-tuned, with the effects that were found."""
        return Model(self._native.model())

    @property
    def nominal(self) -> Model:
        """The nominal model alone, as it was re-tuned before effects were looked for."""
        return Model(self._native.nominal())

    @property
    def html(self) -> str:
        """Text of ``report.html``: one page, nothing from elsewhere."""
        return self._native.html()

    def save(self, folder: Path) -> None:
        """Writes ``report.json``, ``report.html`` and ``model.toml``, as the command ``diagnose`` does.

        An older answer to the same log is replaced. A folder that holds anything else is left alone: :class:`LogError`.
        """
        self._native.save(os.fspath(folder))

    def to_pandas(self, table: str = "effects") -> pandas.DataFrame:
        """A part of the answer as a frame of pandas.

        ``"effects"``: one row a parameter. ``"located"``: one row a channel and phase. ``"residuals"``: one row a row of the log, measured
        less simulated, before (re-tuned nominal model) and after (with the effects): ``…_x_m``, ``…_y_m``, ``…_z_m`` (m) and
        ``…_angle_rad`` (rad) of the object's pose, ``reported`` where the episode is one that nothing was fitted to or chosen by. The
        last simulates the log twice.
        """
        import pandas

        if table == "effects":
            return pandas.DataFrame(_effect_rows(self.effects), columns=_EFFECT_COLUMNS)
        if table == "located":
            return pandas.DataFrame([cell.__dict__ for cell in self.located], columns=list(Cell.__dataclass_fields__))
        if table == "residuals":
            return self._residuals()
        raise ValueError(f"table: expected effects, located or residuals, found {table!r}")

    def _residuals(self) -> pandas.DataFrame:
        import numpy

        result = None
        for when, model in (("before", self.nominal), ("after", self.model)):
            frame = model.simulate(self._log, self._robot).to_pandas()
            if result is None:
                result = frame[["episode", "piece", "time_secs"]].copy()
                reported = [episode for episode, _, _ in self.report["heldout"]["episodes"]]
                result["reported"] = result["episode"].isin(reported)
            for axis in "xyz":
                result[f"{when}_{axis}_m"] = frame[f"measured_object_{axis}_m"] - frame[f"simulated_object_{axis}_m"]
            turns = [frame[[f"{side}_object_q{c}" for c in "xyzw"]].to_numpy() for side in ("measured", "simulated")]
            result[f"{when}_angle_rad"] = _angle(numpy, *turns)
        return result

    def _repr_html_(self) -> str:
        # A page of its own: its style stays inside.
        page = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{page}" title="diagnosis" style="width: 100%; height: 40em; border: 0"></iframe>'

    def __repr__(self) -> str:
        return f"<surmise.Diagnosis of {self._log.name}: {self.summary}>"


def diagnose(
    log: Log,
    robot: Optional[Path] = None,
    *,
    model: Union[Model, Path, None] = None,
    seed: int = 1,
    fold: Optional[tuple[int, int]] = None,
    threads: int = 0,
    progress: Progress = None,
) -> Diagnosis:
    """Finds where simulation and measurement disagree, and which effect the nominal model lacks.

    ``robot``: for a log of an arm (``robot = "sawyer"`` or ``"jaco"``) the project folder, whose ``scenarios/robots`` describes it; without
    it the nearest one above the working folder. A log with ``robot = "none"`` needs none.

    ``model``: begin with this model instead of the nominal one: that of an earlier diagnosis, or the path of a ``model.toml``.

    ``seed``: of the hold-out split and of the bootstrap. ``fold``: ``(i, k)`` holds out part i of k, from 1, instead of the share that the log says.

    ``threads``: worker threads, 0 for one a core; the answer does not depend on it.

    ``progress``: ``True`` for a line on standard error, ``False`` for none, a function that is called with stage, simulated episodes and
    their limit a few times a second, or ``None`` for a line where standard error is a terminal.

    Ctrl-C ends it within the time of one simulated episode, as does an exception of ``progress``. Other threads of Python run meanwhile.

    Raises :class:`LogError` for a log that cannot be diagnosed, with the sentence of the command.
    """
    if not isinstance(log, Log):
        raise TypeError(f"log: expected a Log, as read_log gives it, found {type(log).__name__}")
    for name, number in (("seed", seed), ("threads", threads)):
        if not isinstance(number, int) or not 0 <= number < 2**63:
            raise ValueError(f"{name}: expected a whole number, 0 or more, found {number!r}")
    if model is not None and not isinstance(model, Model):
        model = read_model(model)
    part = None if fold is None else _part(fold)
    told, end = teller(progress)
    try:
        folder = None if robot is None else os.fspath(robot)
        begun = None if model is None else model._native
        native = _surmise.diagnose(log._native, begun, seed, part, folder, threads, told)
    finally:
        end()
    return Diagnosis(native, log, robot)


def _part(fold: Any) -> tuple[int, int]:
    """The part that is held out, from 0, and the number of parts."""
    whole = isinstance(fold, (tuple, list)) and len(fold) == 2 and all(isinstance(number, int) for number in fold)
    if not whole or not 1 <= fold[0] <= fold[1] or not 2 <= fold[1] <= 1000:
        raise ValueError(f"fold: expected (i, k) with 2 to 1000 parts and i from 1 to k, found {fold!r}")
    return (fold[0] - 1, fold[1])


_EFFECT_COLUMNS = ["effect", "confidence", "log_evidence", "parameter", "unit", "value", "low90", "high90"]


def _effect(effect: dict[str, Any]) -> Effect:
    parameters = tuple(
        Parameter(p["name"], p["key"], p["unit"], p["value"], (p["interval90"][0], p["interval90"][1]))
        for p in effect["parameters"]
    )
    return Effect(effect["name"], effect["description"], effect["confidence"], effect["log_evidence"], parameters)


def _effect_rows(effects: list[Effect]) -> list[tuple[Any, ...]]:
    return [
        (effect.name, effect.confidence, effect.log_evidence, p.key, p.unit, p.value, *p.interval90)
        for effect in effects
        for p in effect.parameters
    ]


def _angle(numpy: Any, a: Any, b: Any) -> Any:
    """Angle between orientations, rad; quaternions of shape [rows, 4], whose norms need not be exact."""
    norms = numpy.linalg.norm(a, axis=1) * numpy.linalg.norm(b, axis=1)
    cosine = numpy.abs((a * b).sum(axis=1)) / norms
    return 2.0 * numpy.arccos(numpy.minimum(cosine, 1.0))
