"""How many threads the work runs on."""

from __future__ import annotations

from . import _arrays, _native

__all__ = ["set_threads"]

#: More than any machine has cores; each takes memory of its own.
_MOST = 1024


def set_threads(count: int) -> None:
    """Set the number of threads of what is called from now on.

    Parameters
    ----------
    count : int
        0 for one per core, up to 1024.

    Raises
    ------
    ParameterError
        A number below 0 or above 1024, or none.

    Examples
    --------
    >>> import chladni
    >>> chladni.set_threads(0)
    >>> chladni.set_threads(-1)
    Traceback (most recent call last):
        ...
    chladni.ParameterError: count must be at least 0, got -1
    """
    wanted = _arrays.whole(count, "count")
    if wanted > _MOST:
        raise _arrays.parameter_error(f"count must be at most {_MOST}, got {wanted}")
    _native.set_threads(wanted)
