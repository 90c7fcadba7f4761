"""Conversion of what users pass into the arrays the core reads, with errors that say what came."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int32]

_T = TypeVar("_T")


def _as_array(value: Any, name: str, expected: str) -> npt.NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(
            f"{name}: expected {expected}, got a ragged sequence: give rows of the same length"
        ) from None
    if array.dtype == object:
        raise TypeError(f"{name}: expected {expected}, got an array of Python objects")
    return array


def points(value: Any, name: str, count: int | None = None) -> Float64Array:
    """``value`` as a C-contiguous float64 array of shape (n, 3), copied only if it is not one."""
    rows = "n" if count is None else str(count)
    expected = f"numbers of shape ({rows}, 3)"
    array = _as_array(value, name, expected)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: expected {expected}, got dtype {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3 or (count is not None and array.shape[0] != count):
        raise ValueError(f"{name}: expected shape ({rows}, 3), got {array.shape}")
    return np.ascontiguousarray(array, dtype=np.float64)


def indices(value: Any, name: str, columns: int | None) -> npt.NDArray[np.int64]:
    """``value`` as a C-contiguous int64 array of shape (m, columns), or (m,) without columns."""
    shape = "(m,)" if columns is None else f"(m, {columns})"
    expected = f"integers of shape {shape}"
    array = _as_array(value, name, expected)
    if array.size == 0:
        array = array.reshape((0,) if columns is None else (0, columns)).astype(np.int64)
    if array.dtype.kind not in "iu":
        raise TypeError(f"{name}: expected {expected}, got dtype {array.dtype}")
    if array.ndim != (1 if columns is None else 2) or (
        columns is not None and array.shape[1] != columns
    ):
        raise ValueError(f"{name}: expected shape {shape}, got {array.shape}")
    return np.ascontiguousarray(array, dtype=np.int64)


def vector(value: Any, name: str) -> tuple[float, float, float]:
    """``value`` as three finite floats."""
    array = _as_array(value, name, "three numbers")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name}: expected three numbers, got dtype {array.dtype}")
    if array.shape != (3,):
        raise ValueError(f"{name}: expected shape (3,), got {array.shape}")
    x, y, z = (float(entry) for entry in array)
    if not np.isfinite([x, y, z]).all():
        raise ValueError(f"{name}: expected finite numbers, got {(x, y, z)}")
    return x, y, z


def scalar(value: Any, name: str, *, minimum: float | None = None) -> float:
    """``value`` as a finite float, not below ``minimum``."""
    if isinstance(value, (bool, str)) or not np.isscalar(value):
        raise TypeError(f"{name}: expected a number, got {type(value).__name__}")
    number = float(value)  # type: ignore[arg-type]
    if not np.isfinite(number) or (minimum is not None and number < minimum):
        bound = "a finite number" if minimum is None else f"a finite number, at least {minimum}"
        raise ValueError(f"{name}: expected {bound}, got {number}")
    return number


def number(value: Any, name: str) -> float:
    """``value`` as a float; the core says which are allowed."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.number)):
        raise TypeError(f"{name}: expected a number, got {type(value).__name__}")
    try:
        return float(value)
    except (OverflowError, TypeError):
        raise ValueError(f"{name}: expected a number that a float can hold, got {value}") from None


def instance(value: Any, name: str, kind: type[_T]) -> _T:
    """``value`` if it is one of a class."""
    if isinstance(value, kind):
        return value
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    where = "palpate." if kind.__module__.startswith("palpate.") else ""
    raise TypeError(
        f"{name}: expected {article} {where}{kind.__name__}, got {type(value).__name__}"
    )


def mapping(value: Any, name: str) -> Mapping[Any, Any]:
    """``value`` if it maps names to something."""
    if isinstance(value, Mapping):
        return value
    raise TypeError(f"{name}: expected a mapping such as a dict, got {type(value).__name__}")


def sequence(value: Any, name: str, expected: str) -> list[Any]:
    """``value`` as a list."""
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise TypeError(f"{name}: expected {expected}, got {type(value).__name__}")
    return list(value)


def count(value: Any, name: str, *, minimum: int = 1) -> int:
    """``value`` as an integer, not below ``minimum``."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name}: expected an integer, got {type(value).__name__}")
    if value < minimum:
        raise ValueError(f"{name}: expected an integer of at least {minimum}, got {value}")
    return int(value)
