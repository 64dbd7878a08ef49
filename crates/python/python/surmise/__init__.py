"""Surmise: which physical effect does a simulation of your robot's log lack?

Ten lines, from a folder to a name::

    import surmise

    log = surmise.read_log("tests/data/mujoco-logs/logs/set-003")
    diagnosis = surmise.diagnose(log, seed=1)
    print(diagnosis.summary)
    for effect in diagnosis.effects:
        print(effect.name, effect.confidence, effect.parameters)
    overlay = diagnosis.model.simulate(log).to_pandas()
    diagnosis.save("runs/diagnose/tilt")

All quantities are in SI units and radians; the unit is the end of each name. The same log, seed and version give the same answer as the
command ``diagnose``, byte for byte but for the duration, whatever the number of threads.
"""

from ._diagnosis import Cell, Diagnosis, Effect, Heldout, Parameter, diagnose
from ._log import Log, read_log
from ._model import Model, read_model
from ._surmise import LogError, __version__
from ._table import Table

__all__ = [
    "Cell",
    "Diagnosis",
    "Effect",
    "Heldout",
    "Log",
    "LogError",
    "Model",
    "Parameter",
    "Table",
    "__version__",
    "diagnose",
    "read_log",
    "read_model",
]
