"""What is proven about pairs."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

__all__ = ["Around", "Certificate", "CutCluster", "InertiaCount", "Interval", "LevelReport", "NearPair", "OnBound"]


@dataclass(frozen=True)
class InertiaCount:
    """How many eigenvalues lie below a shift, by Sylvester's law of inertia.

    Attributes
    ----------
    shift : float
        The shift, in the unit of the eigenvalues.
    below : int
        Eigenvalues below it, with multiplicity.
    """

    shift: float
    below: int


@dataclass(frozen=True)
class LevelReport:
    """What one level of the hierarchy took.

    Attributes
    ----------
    dimension : int
        The size of the level's eigenproblem.
    iterations : int
        Iterations; 0 for a level that is solved directly.
    shifts : int
        Shifts that were factored.
    """

    dimension: int
    iterations: int
    shifts: int


@dataclass(frozen=True)
class CutCluster:
    """Eigenvalues so close together that they count as one, of which not all are delivered: any functions of the cluster's eigenspace could stand for those that are.

    Attributes
    ----------
    first : int
        The index of its first eigenvalue among all, from 0.
    end : int
        One more than the index of its last, or of the last that may belong to it.
    """

    first: int
    end: int


@dataclass(frozen=True)
class OnBound:
    """A pair whose enclosure reaches a bound that was asked for: it is for its value that it counts as below the bound or not.

    Attributes
    ----------
    index : int
        Its index among all eigenvalues, from 0.
    value : float
        Its value.
    within : float
        The exact eigenvalue lies within this of the value.
    bound : float
        The bound that lies there too.
    below : bool
        Whether it counts as below.
    """

    index: int
    value: float
    within: float
    bound: float
    below: bool


@dataclass(frozen=True)
class Interval:
    """The bounds that pairs were asked for by.

    Attributes
    ----------
    to : float
        The upper bound, which does not belong to the interval.
    lower : float or None
        The lower bound, which does; None where there is none.
    on_bounds : tuple of OnBound
        Pairs of which rounding does not let one tell on which side of a bound they lie, delivered or not.
    """

    to: float
    lower: float | None = None
    on_bounds: tuple[OnBound, ...] = ()


@dataclass(frozen=True)
class NearPair:
    """A pair as near to a shift as another, as far as enclosures let one tell.

    Attributes
    ----------
    index : int
        Its index among all eigenvalues, from 0.
    value : float
        Its value.
    within : float
        The exact eigenvalue lies within this of the value.
    delivered : bool
        Whether it is one of the pairs that were returned.
    """

    index: int
    value: float
    within: float
    delivered: bool


@dataclass(frozen=True)
class Around:
    """The number that pairs were asked for by, as the nearest to it.

    Attributes
    ----------
    shift : float
        The number.
    ties : tuple of NearPair
        Pairs of which enclosures do not let one tell which are nearer; empty where these pairs are proven to be the nearest.
    """

    shift: float
    ties: tuple[NearPair, ...] = ()


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is proven about each pair and about the whole.

    Attributes
    ----------
    residuals : numpy.ndarray, (k,)
        ``‖S x − θ M x‖ / ‖S x‖``; for the kernel ``‖S x‖ / (‖S‖ ‖x‖)``.
    bounds : numpy.ndarray, (k,)
        Where `complete` is True, the exact eigenvalue of the same index lies within ``θ ± bound``, rounding errors included; otherwise some exact eigenvalue does.
    estimates : numpy.ndarray, (k,) or (0,)
        Estimates of the errors of the eigenvalues, where there are any.
    orthonormality_defect : float
        The largest entry of ``|XᵀMX − I|``.
    complete : bool or None
        Whether inertia counts prove that no eigenvalue was skipped; None: not counted.
    inertia : tuple of InertiaCount
        The counts, by ascending shift.
    first : int
        The index of the first pair among all: 0 but for pairs of an interval.
    interval : Interval or None
        The bounds that the pairs were asked for by; None where a number was asked for.
    around : Around or None
        The number that the pairs are the nearest to, where they were asked for by one.
    cut : CutCluster or None
        The cluster of eigenvalues that the number of pairs cuts, where it is known to cut one.
    tolerance : float or None
        The largest residual that a pair was allowed.
    accuracy : dict or None
        Of an approximation: its goal, the largest estimated relative error, and whether that reaches it.
    levels : tuple of LevelReport
        Coarsest first.
    projection_errors : numpy.ndarray, (k,) or (0,)
        ``‖x − x̃‖ / ‖x‖`` where eigenfunctions were projected to store them compactly.
    """

    residuals: np.ndarray
    bounds: np.ndarray
    estimates: np.ndarray
    orthonormality_defect: float
    complete: bool | None = None
    inertia: tuple[InertiaCount, ...] = ()
    first: int = 0
    interval: Interval | None = None
    around: Around | None = None
    cut: CutCluster | None = None
    tolerance: float | None = None
    accuracy: dict[str, Any] | None = None
    levels: tuple[LevelReport, ...] = ()
    projection_errors: np.ndarray = field(default_factory=lambda: np.empty(0))

    @classmethod
    def _of_json(cls, text: str) -> Certificate:
        own = json.loads(text)

        def array(name: str) -> np.ndarray:
            return np.array([np.nan if x is None else x for x in own.get(name) or []], dtype=float)

        return cls(
            residuals=array("residuals"),
            bounds=array("bounds"),
            estimates=array("estimates"),
            orthonormality_defect=float(own["orthonormality_defect"]),
            complete=own.get("complete"),
            inertia=tuple(InertiaCount(**count) for count in own.get("inertia") or ()),
            first=own.get("first", 0),
            interval=_interval(own.get("interval")),
            around=_around(own.get("around")),
            cut=CutCluster(**own["cut"]) if own.get("cut") else None,
            tolerance=own.get("tolerance"),
            accuracy=own.get("accuracy"),
            levels=tuple(LevelReport(**level) for level in own.get("levels") or ()),
            projection_errors=array("projection_errors"),
        )

    def __repr__(self) -> str:
        proven = {True: "complete", False: "not complete", None: "not counted"}[self.complete]
        largest = f"{self.residuals.max():.1e}" if len(self.residuals) else "none"
        return f"<chladni.Certificate: {proven}, largest residual {largest}, orthonormal to {self.orthonormality_defect:.1e}>"


def _interval(own: dict[str, Any] | None) -> Interval | None:
    if own is None:
        return None
    return Interval(own["to"], own.get("from"), tuple(OnBound(**pair) for pair in own.get("on_bounds") or ()))


def _around(own: dict[str, Any] | None) -> Around | None:
    if own is None:
        return None
    return Around(own["shift"], tuple(NearPair(**pair) for pair in own.get("ties") or ()))
