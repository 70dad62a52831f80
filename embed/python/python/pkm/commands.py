"""Commands of pkm-host: files in, files and a data class out.

Each has the program's options as keywords, those with a type and any other, and its defaults: without `machine` the reference machine, without data the ones that come with the program.
Outputs are written whole or not at all. What the program warns of is a `pkm.Warning`.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from . import _core
from .errors import UsageError, Warning
from .results import (
    Compensation,
    Diagnosis,
    Document,
    Effect,
    Fit,
    Place,
    Placement,
    Prediction,
    ReadingErrors,
)

FilePath = str | os.PathLike[str]
Form = Literal["auto", "diagonal", "factor"]
Objective = Literal["paper", "tip-worst", "tip-mean"]
Option = FilePath | float | np.generic | Sequence[float] | Sequence[str] | Mapping[str, str] | bool | None


def run(command: str, *files: FilePath, **options: Option) -> Document:
    """Any command that computes from files, by name: all but `view`, `demo`, `fem` and `hil`. Returns the JSON document.

    `files` are what a command takes without a name, such as that of `check`. Options are keywords: `step_mm=5` is `--step-mm=5`.

    None and False leave an option out, True gives it without a value; numbers of a list are joined by commas, texts of a list
    are given one after another, and a mapping is its pairs: `columns={"dx_um": "X"}` is `--columns=dx_um=X`.
    """
    return _document([command, *(os.fspath(file) for file in files)], options)


def _document(arguments: list[str], options: Mapping[str, Option]) -> Document:
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        arguments += [option if text is None else f"{option}={text}" for text in _texts(name, value)]
    document: Document = json.loads(_core.run(arguments))
    for warning in document.get("warnings", ()):
        warnings.warn(warning, Warning, stacklevel=3)
    return document


def _texts(name: str, value: Option) -> Sequence[str | None]:
    """What an option is given, once each; None: its name alone."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return _texts(name, value.item())
    if value is None or isinstance(value, bool):
        return [None] if value else []
    if isinstance(value, os.PathLike):
        return [os.fspath(value)]
    if isinstance(value, (str, int, float)):
        return [str(value)]
    if hasattr(value, "to_csv"):
        raise UsageError(f"{name}: expected the path of a file, found a {type(value).__name__}: write it with to_csv(index=False)")
    if isinstance(value, Mapping):
        return [",".join(f"{new}={theirs}" for new, theirs in value.items())]
    if all(isinstance(item, str) for item in value):
        return [str(item) for item in value]
    return [",".join(str(float(item)) for item in value)]


def fit(
    out: FilePath,
    *,
    machine: FilePath | None = None,
    data: FilePath | None = None,
    verify: FilePath | None = None,
    terms: Literal["paper", "full", "select"] = "paper",
    **options: Option,
) -> Fit:
    """Fits correction tables to the stiffness CSV `data` and judges them by `verify`; writes them to the folder `out`."""
    own: dict[str, Option] = {"machine": machine, "data": data, "verify": verify, "terms": terms, "out": out}
    document = _document(["fit"], options | own)
    return Fit(
        document=document,
        folder=Path(out),
        poses=document["train"]["poses"],
        terms=document["terms"],
        condition=document["condition"],
    )


def diagnose(
    out: FilePath,
    *,
    machine: FilePath | None = None,
    data: FilePath | None = None,
    holdout: FilePath | None = None,
    method: Literal["places", "formulas"] = "places",
    **options: Option,
) -> Diagnosis:
    """From the measured deflections `data` to the physics that the machine file lacks; writes the identified machine to `out`."""
    own: dict[str, Option] = {"machine": machine, "data": data, "holdout": holdout, "method": method, "out": out}
    document = _document(["diagnose"], options | own)
    effects = [
        Effect(
            id=effect["id"],
            where=effect["where"],
            of=effect["of"],
            confidence=effect["confidence"],
            probability=effect["probability"],
            parameters={name: (p["value"], p["stderr"]) for name, p in effect["parameters"].items()},
        )
        for effect in document["effects"]
    ]
    return Diagnosis(
        document=document,
        folder=Path(out),
        verdict=document["verdict"],
        effects=effects,
        before=ReadingErrors.of(document["error_before"]),
        after=ReadingErrors.of(document["error_after"]),
        holdout_before=ReadingErrors.of(document["holdout"]["before"]),
        holdout_after=ReadingErrors.of(document["holdout"]["after"]),
    )


def predict(
    out: FilePath,
    *,
    machine: FilePath | None = None,
    data: FilePath | None = None,
    table: FilePath | None = None,
    form: Form = "auto",
    **options: Option,
) -> Prediction:
    """Writes the measured file `data` with the model's deflections in place of the readings to the CSV `out`."""
    form_of_table = form if table is not None else None
    own: dict[str, Option] = {"machine": machine, "data": data, "table": table, "form": form_of_table, "out": out}
    document = _document(["predict"], options | own)
    return Prediction(document, path=Path(out), rows=document["rows"], outside_box=document["outside_box"])


def place(
    out: FilePath,
    *,
    machine: FilePath | None = None,
    table: FilePath | None = None,
    form: Form = "auto",
    job: FilePath | None = None,
    objectives: Sequence[Objective] = (),
    method: Literal["grid", "ga", "de", "certified"] | None = None,
    step_mm: float = 2.0,
    step_deg: float | None = None,
    seed: int | None = None,
    allow_extrapolation: bool = False,
    **options: Option,
) -> Placement:
    """Puts the workpiece of a job file where its holes are drilled best; writes placement.json and a report to `out`."""
    own: dict[str, Option] = {
        "machine": machine,
        "table": table,
        "form": form if table is not None else None,
        "job": job,
        "objective": objectives,
        "method": method,
        "step_mm": step_mm,
        "step_deg": step_deg,
        "seed": seed,
        "allow_extrapolation": allow_extrapolation,
        "out": out,
    }
    document = _document(["place"], options | own)
    keys = ("objective", "dx_mm", "dy_mm", "rotary_deg", "value", "unit", "holes")
    places = [Place(series=series["name"], **{key: series[key] for key in keys}) for series in document["series"]]
    return Placement(document, folder=Path(out), places=places)


def compensate(
    out: FilePath,
    path: FilePath,
    *,
    machine: FilePath | None = None,
    table: FilePath | None = None,
    wrench: Sequence[float] | None = None,
    job: FilePath | None = None,
    tools: FilePath | None = None,
    limits: FilePath | None = None,
    step_mm: float | None = None,
    chord_mm: float | None = None,
    interpreter: FilePath | None = None,
    block_delete: bool = False,
    allow_extrapolation: bool = False,
    **options: Option,
) -> Compensation:
    """Writes the tool path `path` (CSV or G-code) so that it cancels the predicted deflection to the file `out`.

    `wrench` is the load in N and N·m on the tool at its tip, in the tool's axes. `interpreter="rs274"` has LinuxCNC's interpreter
    read a program.
    """
    own: dict[str, Option] = {
        "machine": machine,
        "table": table,
        "path": path,
        "wrench": wrench,
        "job": job,
        "tools": tools,
        "limits": limits,
        "step_mm": step_mm,
        "chord_mm": chord_mm,
        "interpreter": interpreter,
        "block_delete": block_delete,
        "allow_extrapolation": allow_extrapolation,
        "out": out,
    }
    document = _document(["compensate"], options | own)
    before, after = document["error_before_um"], document["error_after_um"]
    return Compensation(
        document,
        path=Path(document["out"]),
        report=Path(document["report"]),
        points=document["points"],
        before_um_rms=before["rms"],
        before_um_max=before["max"],
        after_um_rms=after["rms"],
        after_um_max=after["max"],
        extrapolated_points=document["extrapolated_points"],
    )
