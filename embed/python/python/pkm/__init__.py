"""Kinematics and stiffness of an Exechon-like parallel kinematic machine, on NumPy arrays.

`Model` computes arrays of poses with the controller's own code, bit for bit. `fit`, `diagnose`, `predict`, `place` and
`compensate` are commands of pkm-host, files in, files and a data class out; `run` is any other by name.
"""

from . import errors, results
from ._core import Model
from .commands import compensate, diagnose, fit, place, predict, run
from .errors import Error, ExtrapolationWarning, RefusedError, Warning

__all__ = [
    "Error",
    "ExtrapolationWarning",
    "Model",
    "RefusedError",
    "Warning",
    "compensate",
    "diagnose",
    "errors",
    "fit",
    "place",
    "predict",
    "results",
    "run",
]
