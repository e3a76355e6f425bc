"""The exceptions of the package. All carry what the library said, which names the offending element."""

from __future__ import annotations

from typing import Any

__all__ = ["Cancelled", "ClientError", "Error", "FormatError", "MeshError", "ParameterError", "SolveError", "UnprovenError"]


class Error(Exception):
    """What every exception of this package is.

    Attributes
    ----------
    code : str
        A stable identifier in kebab case, such as ``"index-out-of-range"``: for programs, where the message is for people.
    """

    code: str = "error"


class MeshError(Error, ValueError):
    """A mesh that cannot be used: an index out of range, a coordinate that is not finite, no face with an area."""


class ParameterError(Error, ValueError):
    """An argument out of its range, of another shape, of another type, or one that belongs to another method."""


class SolveError(Error, RuntimeError):
    """Work that ended without a result."""


class UnprovenError(SolveError):
    """Pairs that did not converge to the tolerance, or that could not be proven complete. Nothing half-right is ever returned."""


class FormatError(Error, ValueError):
    """A file that is not what it must be."""


class Cancelled(Error):
    """Work that was asked to stop."""


class ClientError(Error, RuntimeError):
    """What a server answered instead of a result.

    Attributes
    ----------
    status : int
        The status of HTTP; 0 where the server did not answer at all.
    problem : dict
        The problem (RFC 9457) as the server sent it; empty where it sent none.
    """

    status: int = 0
    problem: dict[str, Any] = {}
