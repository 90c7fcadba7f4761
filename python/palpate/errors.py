"""What palpate raises beside the ``ValueError`` and ``TypeError`` that bad arguments raise."""

from __future__ import annotations

from dataclasses import dataclass


class PalpateError(Exception):
    """Base of the errors that are palpate's own."""


class MeshError(PalpateError, ValueError):
    """A mesh that cannot be used, or a mesh file that cannot be read.

    Attributes
    ----------
    path : str or None
        The file, where there is one.
    line : int or None
        Line of the file, counted from 1, where the format has lines.
    """

    def __init__(self, message: str, path: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.path = path
        self.line = line


@dataclass(frozen=True)
class Diagnostic:
    """One finding in a model file; line and column are counted from 1."""

    path: str
    line: int
    column: int
    message: str
    hint: str | None


class ModelError(PalpateError, ValueError):
    """A model that cannot be read. Its text shows every finding with its line and a caret.

    Attributes
    ----------
    path, line, column : str, int, int
        Where the first finding is; line and column are counted from 1.
    diagnostics : tuple of Diagnostic
        All findings, in the order of the text.
    """

    def __init__(self, message: str, diagnostics: tuple[Diagnostic, ...]) -> None:
        super().__init__(message)
        self.diagnostics = diagnostics
        first = diagnostics[0] if diagnostics else Diagnostic("", 1, 1, message, None)
        self.path = first.path
        self.line = first.line
        self.column = first.column


class SimulationError(PalpateError, RuntimeError):
    """A simulation that cannot start or go on; the state is that before the failed step.

    Where a step failed stands in ``body`` (its index), ``node`` (that is to blame, or else the
    first that is lost) and ``tetrahedron`` (the node's first; None of a rigid body), else None.
    """

    def __init__(
        self,
        message: str,
        body: int | None = None,
        node: int | None = None,
        tetrahedron: int | None = None,
    ) -> None:
        super().__init__(message)
        self.body = body
        self.node = node
        self.tetrahedron = tetrahedron


class CheckpointError(PalpateError, ValueError):
    """A checkpoint file that is damaged or not one of ours."""
