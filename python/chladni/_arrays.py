"""What users pass as arrays, made into what the native module takes: checked, contiguous, of the right type. Copies are made only where these differ."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from ._errors import ParameterError


def parameter_error(message: str) -> ParameterError:
    """A refusal of an argument."""
    error = ParameterError(message)
    error.code = "invalid-parameters"
    return error


def positions(vertices: Any) -> np.ndarray:
    """Positions as C-contiguous float64, (n, 3). Points in the plane, (n, 2), get a third coordinate of zero."""
    array = numeric(vertices, "vertices")
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise parameter_error(f"vertices must have shape (n, 3), got {array.shape}")
    if array.shape[1] == 2:
        array = np.column_stack([array, np.zeros(len(array))])
    return np.ascontiguousarray(array, dtype=np.float64)


def triangles(faces: Any) -> np.ndarray:
    """Triangles as C-contiguous int64, (f, 3)."""
    array = np.asarray(faces)
    if array.size == 0:
        array = array.reshape(-1, 3).astype(np.int64)
    if array.dtype.kind not in "iu":
        raise parameter_error(f"faces must be integers, got dtype {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise parameter_error(f"faces must have shape (f, 3), got {array.shape}; each row has the three vertices of a triangle")
    if array.dtype == np.uint64 and array.size and (largest := int(array.max())) >= 2**63:
        face = int(np.argmax(array.max(axis=1)))
        raise parameter_error(f"face {face} refers to vertex {largest}, which does not exist")
    return np.ascontiguousarray(array, dtype=np.int64)


def numeric(values: Any, what: str) -> np.ndarray:
    """An array of real numbers as float64."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise parameter_error(f"{what} must not be a masked array: fill the masked entries first")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise parameter_error(f"{what} must be an array: {error}") from None
    if array.dtype.kind not in "fiub":
        raise parameter_error(f"{what} must be real numbers, got dtype {array.dtype}")
    return array.astype(np.float64, copy=False)


def whole(value: Any, name: str, least: int = 0) -> int:
    """A whole number: of any type that holds one exactly, but no truth value and no text."""
    truth = isinstance(value, (bool, np.bool_))
    try:
        given = None if truth or isinstance(value, (str, bytes)) else int(value)
        exact = given is not None and bool(given == value)
    except (TypeError, ValueError, OverflowError):
        exact = False
    if not exact or given is None:
        raise parameter_error(f"{name} must be a whole number, got {value!r}")
    if given < least:
        raise parameter_error(f"{name} must be at least {least}, got {given}")
    if given >= 2**64:
        raise parameter_error(f"{name} must be less than 2**64, got {given}")
    return given


def number(value: Any, name: str) -> float:
    """A finite number."""
    try:
        given = float(value)
    except (TypeError, ValueError, OverflowError):
        raise parameter_error(f"{name} must be a number, got {value!r}") from None
    if not np.isfinite(given):
        raise parameter_error(f"{name} must be a finite number, got {given}")
    return given


def functions(values: Any, rows: int, what: str) -> tuple[np.ndarray, bool]:
    """Functions in Fortran order, (rows, k), and whether it was a single one of the shape (rows,)."""
    array = numeric(values, what)
    single = array.ndim == 1
    if single:
        array = array[:, None]
    if array.ndim != 2 or array.shape[0] != rows:
        raise parameter_error(f"{what} must have shape ({rows},) or ({rows}, k), got {np.shape(values)}")
    return np.asfortranarray(array), single


def finite(values: np.ndarray, kept: np.ndarray, what: str, kind: str = "vertex") -> None:
    """Refuses functions with a number at a kept vertex that is not finite; those at dropped ones are not looked at. `kept` tells which are kept, `kind` what the rows are of."""
    bad = ~np.isfinite(values).all(axis=1) & kept
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        column = int(np.flatnonzero(~np.isfinite(values[row]))[0])
        of = f" of function {column}" if values.shape[1] > 1 else ""
        raise parameter_error(f"{what} must be finite numbers, got {values[row, column]} at {kind} {row}{of}")


def vertex_list(vertices: Any, what: str, kind: str = "vertex") -> tuple[list[int], bool]:
    """Numbers of vertices, or of another `kind` of thing, and whether it was a single one."""
    array = np.asarray(vertices)
    if array.dtype.kind not in "iu" or array.ndim > 1:
        many = "vertices" if kind == "vertex" else f"{kind}s"
        given = repr(vertices) if np.size(vertices) <= 8 and array.ndim <= 1 else f"an array of the dtype {array.dtype} and the shape {array.shape}"
        raise parameter_error(f"{what} must be the index of a {kind} or a list of indices of {many}, got {given}")
    single = array.ndim == 0
    listed = [int(vertex) for vertex in np.atleast_1d(array)]
    for place, vertex in enumerate(listed):
        if not 0 <= vertex < 2**32 - 1:
            raise parameter_error(f"{what}: entry {place} is {kind} {vertex}, which does not exist")
    return listed, single


def flag(value: str, name: str, choices: tuple[str, ...]) -> None:
    """Refuses what is none of the choices."""
    if value not in choices:
        raise parameter_error(f"{name} must be one of {', '.join(choices)}, got {value!r}")


def progress_callback(progress: Any) -> tuple[Callable[[str, float], Any] | None, Callable[[], None]]:
    """What the native module calls with the stage and its fraction, and what ends it."""
    if progress is None or progress is False:
        return None, lambda: None
    if callable(progress):
        return progress, lambda: None
    if progress is not True and not isinstance(progress, np.bool_):
        raise parameter_error(f"progress must be True, False or a callable that takes the stage and its fraction, got {progress!r}")
    if not progress:
        return None, lambda: None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None, lambda: None
    bar = tqdm(total=1.0, bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}", leave=False)

    def told(stage: str, fraction: float) -> None:
        bar.set_description_str(stage or "starting", refresh=False)
        bar.n = min(max(fraction, 0.0), 1.0)
        bar.refresh()

    return told, bar.close
