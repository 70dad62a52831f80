"""Kinematics and stiffness of an Exechon-like parallel kinematic machine, on NumPy arrays.

`Model` computes arrays of poses with the controller's own code, bit for bit. `fit`, `diagnose`, `predict`, `place` and
`compensate` are commands of pkm-host, files in, files and a data class out; `run` is any other by name.
"""

from importlib.metadata import version

from . import errors, results
from ._core import Model
from .commands import compensate, diagnose, fit, place, predict, run
from .errors import (
    Error,
    ExtrapolationWarning,
    InputError,
    NoStiffnessError,
    NotFiniteError,
    OtherError,
    OutOfTravelError,
    RefusedError,
    SingularError,
    UnreachableError,
    UsageError,
)
from .errors import Warning as Warning  # not in __all__: `from pkm import *` leaves Python's own

__version__ = version("pkm")

__all__ = [
    "Error",
    "ExtrapolationWarning",
    "InputError",
    "Model",
    "NoStiffnessError",
    "NotFiniteError",
    "OtherError",
    "OutOfTravelError",
    "RefusedError",
    "SingularError",
    "UnreachableError",
    "UsageError",
    "compensate",
    "diagnose",
    "errors",
    "fit",
    "place",
    "predict",
    "results",
    "run",
]
