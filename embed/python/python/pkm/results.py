"""What the commands give: data classes over the program's JSON documents, and their tables for pandas.

`document` is the whole document; its keys are in docs/formats.md. Units stand in names.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas

Document = dict[str, Any]

PRINCIPAL = ("k11", "k22", "k33", "k44", "k55", "k66")
COMPONENTS = ("dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad")
WRENCH = ("fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm")


def _frame(rows: Sequence[Document], index: str | list[str] | None = None) -> pandas.DataFrame:
    # a wheel without pandas does all the rest
    import pandas

    frame: pandas.DataFrame = pandas.DataFrame(list(rows))
    if index is not None:
        frame = frame.set_index(index)
    return frame


@dataclass(frozen=True)
class Result:
    """What every command gives."""

    document: Document = field(repr=False)

    @property
    def warnings(self) -> list[str]:
        """What the program warned of."""
        return list(self.document["warnings"])


@dataclass(frozen=True)
class Fit(Result):
    """Correction tables fitted to stiffness data."""

    folder: Path
    poses: int
    terms: list[list[int]] = field(repr=False)
    condition: float

    @property
    def table(self) -> Path:
        """coefficients.json, for `Model(table=...)`."""
        return self.folder / "coefficients.json"

    @property
    def report(self) -> Path:
        return self.folder / "report.html"

    def to_pandas(self) -> pandas.DataFrame:
        """Errors of k11 to k66 as in the paper's Tables 3 and 4: a row for each set of poses, model and statistic.

        `re_percent` of the basic model, of the diagonal form and of the factor form, and the diagonal form's `me`.
        """
        kinds = [("basic", "re_percent"), ("improved", "re_percent"), ("factor", "re_percent"), ("improved", "me")]
        rows = [
            {"poses": poses, "model": model, "measure": measure, "statistic": statistic, **dict(zip(PRINCIPAL, values))}
            for poses in ("train", "verify")
            if self.document[poses] is not None
            for model, measure in kinds
            if self.document[poses].get(model) is not None
            for statistic, values in self.document[poses][model][measure].items()
            if statistic != "bands"
        ]
        return _frame(rows, ["poses", "model", "measure", "statistic"])

    def deflections_to_pandas(self) -> pandas.DataFrame:
        """Errors in percent of the deflection at A under a load of each component alone, by model."""
        rows = [
            {"poses": poses, "model": model, "statistic": statistic, **dict(zip(WRENCH, values))}
            for poses in ("train", "verify")
            if self.document[poses] is not None
            for model, statistics in self.document[poses]["deflection_percent"].items()
            if statistics is not None
            for statistic, values in statistics.items()
        ]
        return _frame(rows, ["poses", "model", "statistic"])


@dataclass(frozen=True)
class ReadingErrors:
    """How far a model is from readings."""

    linear_um_rms: float
    linear_um_max: float
    linear_percent: float
    angular_urad_rms: float
    angular_percent: float
    chi2_per_dof: float
    readings: int

    @classmethod
    def of(cls, document: Document) -> ReadingErrors:
        return cls(**{name: document[name] for name in cls.__dataclass_fields__})


@dataclass(frozen=True)
class Effect:
    """Something that the declared model lacks, where it is, and its parameters as (value, standard error)."""

    id: str
    where: str
    of: str
    confidence: float
    probability: float
    parameters: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Diagnosis(Result):
    """What measured deflections say about a machine."""

    folder: Path
    verdict: str
    effects: list[Effect]
    before: ReadingErrors
    after: ReadingErrors
    holdout_before: ReadingErrors
    holdout_after: ReadingErrors

    @property
    def machine(self) -> Path:
        """The identified machine's file, for `Model(machine=...)`."""
        return self.folder / "machine.toml"

    @property
    def table(self) -> Path:
        """Its table, for `Model(machine=..., table=...)`."""
        return self.folder / "coefficients.json"

    @property
    def report(self) -> Path:
        return self.folder / "report.html"

    def to_pandas(self) -> pandas.DataFrame:
        """The readings, a row each, with what the declared (`before`) and the identified model (`after`) say."""
        rows = []
        for reading in self.document["readings"]:
            row = {name: reading[name] for name in ("line", "theta_deg", "sigma_deg", "z0_mm")}
            row |= dict(zip(WRENCH, reading["wrench"]))
            for kind in ("read", "before", "after"):
                # a gauge reads one number, along its direction
                names = COMPONENTS if reading["gauge"] is None else ("gauge_um",)
                row |= {f"{name}_{kind}": value for name, value in zip(names, reading[kind])}
            rows.append(row | {"excluded": reading["excluded"]})
        return _frame(rows, "line")

    def errors_to_pandas(self) -> pandas.DataFrame:
        """Errors of the declared model and of each that was tried beside the identified one, on held-out poses."""
        models = ("before", "table_only", "retuned_only", "after", "after_and_table")
        held_out = self.document["holdout"]
        rows = [{"model": name, **vars(ReadingErrors.of(held_out[name]))} for name in models if held_out.get(name)]
        return _frame(rows, "model")


@dataclass(frozen=True)
class Place:
    """Where a series of holes is drilled best by an objective."""

    series: str
    objective: str
    dx_mm: float
    dy_mm: float
    rotary_deg: float
    value: float
    unit: str
    holes: list[Document] = field(repr=False)


@dataclass(frozen=True)
class Placement(Result):
    """Where the workpiece should stand."""

    folder: Path
    places: list[Place]

    @property
    def report(self) -> Path:
        return self.folder / "report.html"

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each hole of each series and objective."""
        rows = []
        for place in self.places:
            for number, hole in enumerate(place.holes, 1):
                row = {"series": place.series, "objective": place.objective, "hole": number}
                row |= {f"q{i}_mm": q for i, q in enumerate(hole["q_mm"], 1)} | dict(zip(PRINCIPAL, hole["k"]))
                rows.append(row | {key: value for key, value in hole.items() if key not in ("q_mm", "k")})
        return _frame(rows, ["series", "objective", "hole"])


@dataclass(frozen=True)
class Compensation(Result):
    """A tool path that cancels the predicted deflection; errors of the tip by the model."""

    path: Path
    report: Path
    points: int
    before_um_rms: float
    before_um_max: float
    after_um_rms: float
    after_um_max: float
    extrapolated_points: int


@dataclass(frozen=True)
class Prediction(Result):
    """A measured file with the model's deflections in place of the readings."""

    path: Path
    rows: int
    outside_box: int

    def to_pandas(self) -> pandas.DataFrame:
        """The file's rows: numbers as float, texts as they stand."""
        lines = [line for line in self.path.read_text(encoding="utf-8-sig").splitlines() if not line.startswith("#")]
        delimiter = next((mark for mark in ";\t" if mark in lines[0]), ",")
        names, *rows = csv.reader(lines, delimiter=delimiter)
        frame = _frame([dict(zip(names, row)) for row in rows])
        # names stay as they are, also such as 00
        for name in frame.columns.difference(["pose", "series"]):
            numbers = frame[name].str.replace(",", ".") if delimiter != "," else frame[name]
            try:
                frame[name] = numbers.replace("", "nan").astype(float)
            except ValueError:
                pass  # a column of texts
        return frame
