"""What is raised, each kind of failure with its own type.

A batch raises at the first row that is refused, and gives nothing: no row of a result is ever NaN. Take the rows that
`Model.reachable` says yes to where some may be refused.
"""

from __future__ import annotations


class Error(Exception):
    """Any failure. `file`, `line` and `column` (a column or key) are of the input, `row` is of the array, from 0."""

    def __init__(
        self,
        message: str,
        row: int | None = None,
        file: str | None = None,
        line: int | None = None,
        column: str | None = None,
    ) -> None:
        super().__init__(message)
        self.row = row
        self.file = file
        self.line = line
        self.column = column


class UsageError(Error, ValueError):
    """Bad arguments, such as an array of another shape."""


class InputError(Error, ValueError):
    """A bad file, with line and column or key."""


class RefusedError(Error):
    """A pose or tool that the machine cannot take; `status` is the word of the program's JSON."""

    status = ""


class OutOfTravelError(RefusedError):
    """A screw would leave its travel, or a joint of the wrist its limits."""

    status = "out_of_travel"


class UnreachableError(RefusedError):
    """No assembly in the working mode."""

    status = "unreachable"


class SingularError(RefusedError):
    """Too near to a singularity."""

    status = "singular"


class NotFiniteError(RefusedError):
    """An input is NaN or infinite."""

    status = "not_finite"


class NoStiffnessError(RefusedError):
    """The stiffness is not positive definite, as far outside a table's box."""

    status = "no_stiffness"


class OtherError(Error):
    """Anything else, such as a folder that cannot be written."""


class Warning(UserWarning):
    """What the program warns of."""


class ExtrapolationWarning(Warning):
    """Poses outside the box that a table was fitted on."""
