"""Commands of pkm-host: files in, files and a data class out.

Each has the program's defaults: without `machine` the reference machine, without data the ones that come with the program.
Outputs are written whole or not at all. What the program warns of is a `pkm.Warning`.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from . import _core
from .errors import Warning
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
Option = FilePath | float | Sequence[float] | Sequence[str] | bool | None


def run(command: str, **options: Option) -> Document:
    """Any command that computes from files, by name: all but `view`, `demo`, `fem` and `hil`. Returns the JSON document.

    Options are keywords: `step_mm=5` is `--step-mm=5`.

    None and False leave an option out, True gives it without a value; numbers of a list are joined by commas, texts of a list
    are given one after another.
    """
    arguments = [command]
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            arguments.append(option)
        elif isinstance(value, (str, os.PathLike, int, float)):
            arguments.append(f"{option}={os.fspath(value) if isinstance(value, os.PathLike) else value}")
        elif all(isinstance(item, str) for item in value):
            arguments += [f"{option}={item}" for item in value]
        else:
            arguments.append(f"{option}={','.join(str(float(item)) for item in value)}")
    document: Document = json.loads(_core.run(arguments))
    for warning in document.get("warnings", ()):
        warnings.warn(warning, Warning, stacklevel=3)
    return document


def fit(
    out: FilePath,
    *,
    machine: FilePath | None = None,
    data: FilePath | None = None,
    verify: FilePath | None = None,
    terms: Literal["paper", "full", "select"] = "paper",
) -> Fit:
    """Fits correction tables to the stiffness CSV `data` and judges them by `verify`; writes them to the folder `out`."""
    document = run("fit", machine=machine, data=data, verify=verify, terms=terms, out=out)
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
) -> Diagnosis:
    """From the measured deflections `data` to the physics that the machine file lacks; writes the identified machine to `out`."""
    document = run("diagnose", machine=machine, data=data, holdout=holdout, method=method, out=out)
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
) -> Prediction:
    """Writes the measured file `data` with the model's deflections in place of the readings to the CSV `out`."""
    form_of_table = form if table is not None else None
    document = run("predict", machine=machine, data=data, table=table, form=form_of_table, out=out)
    return Prediction(document, path=Path(out), rows=document["rows"], outside_box=document["outside_box"])


def place(
    out: FilePath,
    *,
    machine: FilePath | None = None,
    table: FilePath | None = None,
    form: Form = "auto",
    job: FilePath | None = None,
    objectives: Sequence[Objective] = (),
    method: Literal["grid", "ga", "de"] | None = None,
    step_mm: float = 2.0,
    step_deg: float | None = None,
    seed: int | None = None,
    allow_extrapolation: bool = False,
) -> Placement:
    """Puts the workpiece of a job file where its holes are drilled best; writes placement.json and a report to `out`."""
    document = run(
        "place",
        machine=machine,
        table=table,
        form=form if table is not None else None,
        job=job,
        objective=objectives,
        method=method,
        step_mm=step_mm,
        step_deg=step_deg,
        seed=seed,
        allow_extrapolation=allow_extrapolation,
        out=out,
    )
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
) -> Compensation:
    """Writes the tool path `path` (CSV or G-code) so that it cancels the predicted deflection to the file `out`.

    `wrench` is the load in N and N·m on the tool at its tip, in the tool's axes. `interpreter="rs274"` has LinuxCNC's interpreter
    read a program.
    """
    document = run(
        "compensate",
        machine=machine,
        table=table,
        path=path,
        wrench=wrench,
        job=job,
        tools=tools,
        limits=limits,
        step_mm=step_mm,
        chord_mm=chord_mm,
        interpreter=interpreter,
        block_delete=block_delete,
        allow_extrapolation=allow_extrapolation,
        out=out,
    )
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
