"""Vibration modes of elastic shells and solids: frequencies, motion, sound."""

from __future__ import annotations

import json
from typing import Any, Callable

import numpy as np

from . import _arrays, _native
from ._basis import _plain
from ._errors import ParameterError
from ._mesh import Mesh, as_mesh

__all__ = ["Vibration", "vibration"]


class Vibration:
    """The vibration modes of an elastic object: what `vibration` gives.

    Attributes
    ----------
    mesh : Mesh
        The mesh.
    values : numpy.ndarray, (m,)
        Squared angular frequencies ω², ascending; 0 for rigid motions, which come first.
    frequencies : numpy.ndarray, (m,)
        ω / 2π, in 1/time.
    bounds : numpy.ndarray, (m,)
        An exact value lies within this distance of each of ``values``.
    rigid : int
        How many modes are rigid motions.
    metadata : dict
        How the modes were made.
    """

    _core: _native.Vibration
    mesh: Mesh

    def __init__(self) -> None:
        raise TypeError("vibrations come from chladni.vibration")

    @property
    def values(self) -> np.ndarray:  # noqa: D102
        return np.array(self._core.values())

    @property
    def frequencies(self) -> np.ndarray:  # noqa: D102
        return np.sqrt(np.maximum(self.values, 0)) / (2 * np.pi)

    @property
    def bounds(self) -> np.ndarray:  # noqa: D102
        return np.array(self._core.bounds())

    @property
    def rigid(self) -> int:  # noqa: D102
        return self._core.rigid()

    @property
    def metadata(self) -> dict[str, Any]:  # noqa: D102
        return json.loads(self._core.metadata())

    def __len__(self) -> int:
        return len(self._core.values())

    def simulate(self, times: Any, loads: list[dict[str, Any]], *, damping: tuple[float, float] = (0.0, 0.0), **request: Any) -> np.ndarray:
        """Follow the motion that loads cause, exactly at each time.

        Parameters
        ----------
        times : array_like, (t,)
            When, ascending.
        loads : list of dict
            ``{"impulse": {"vertex": 17, "momentum": [0, 0, -0.01]}}``, ``{"force": {"vertex": …, "from": …, "to": …, "force": […]}}`` or
            ``{"body": {"acceleration": […]}}``, as the API has them.
        damping : (float, float)
            ``(α, β)`` of ``α M + β K``, in 1/time and in time.
        **request
            Further members of the request of the API: ``initial``, ``vertices``.

        Returns
        -------
        numpy.ndarray of float32, (t, n, 3)
            The displacement of each vertex at each time.

        Examples
        --------
        >>> import chladni
        >>> bell = chladni.vibration(chladni.Mesh.sample("bell", 600), k=12, thickness=0.02)
        >>> bell.simulate([0.0, 0.1], [{"impulse": {"vertex": 5, "momentum": [0, 0, 0.01]}}]).shape == (2, len(bell.mesh.vertices), 3)
        True
        """
        if "give" in request:
            raise ParameterError("give is not available here: the result is always displacements")
        wish = {"times": np.asarray(times, dtype=float).tolist(), "loads": loads, "damping": _damping(damping), **request}
        found = self._core.simulate(json.dumps(wish, default=_plain))
        return found.reshape(found.shape[0], found.shape[1] // 3, 3)

    def sound(
        self,
        loads: list[dict[str, Any]],
        listener: Any,
        *,
        seconds: float = 1.0,
        sample_rate: int = 44100,
        damping: tuple[float, float] = (0.0, 0.0),
    ) -> np.ndarray:
        """Hear what loads cause: Rayleigh's integral over the surface.

        Parameters
        ----------
        loads, damping
            As for `simulate`.
        listener : array_like, (3,)
            Where the ear is.
        seconds : float
            How long.
        sample_rate : int
            Samples a second.

        Returns
        -------
        numpy.ndarray, (seconds · sample_rate,)
            Pressures; modes above half the sample rate are left out.

        Examples
        --------
        >>> import chladni
        >>> bell = chladni.vibration(chladni.Mesh.sample("bell", 600), k=12, thickness=0.02)
        >>> bell.sound([{"impulse": {"vertex": 5, "momentum": [0, 0, 0.01]}}], [0, 0, 3], seconds=0.1).shape
        (4410,)
        """
        sound = {"listener": np.asarray(listener, dtype=float).tolist(), "seconds": seconds, "sample_rate": sample_rate}
        pressures, _ = self._core.sound(json.dumps({"loads": loads, "damping": _damping(damping), "sound": sound}, default=_plain))
        return pressures

    def __repr__(self) -> str:
        told = self.frequencies[self.rigid :]
        span = f", {told[0]:.4g} to {told[-1]:.4g}" if len(told) else ""
        return f"<chladni.Vibration: {len(self)} modes, {self.rigid} of them rigid{span}>"


def _damping(damping: tuple[float, float]) -> dict[str, float]:
    alpha, beta = damping
    return {"alpha": float(alpha), "beta": float(beta)}


def vibration(
    vertices: Any,
    faces: Any = None,
    *,
    k: int | None = None,
    thickness: float | None = None,
    young: float | None = None,
    poisson: float | None = None,
    density: float | None = None,
    clamped: Any = (),
    progress: bool | Callable[[str, float], Any] = False,
    **parameters: Any,
) -> Vibration:
    """Compute the vibration modes of a thin shell, or of a solid of tetrahedra.

    Parameters
    ----------
    vertices, faces
        The mesh, as for `eigs`.
    k : int, optional
        The number of modes, rigid ones among them.
    thickness : float, optional
        Of the shell, in units of the mesh; a solid has none.
    young, poisson, density : float, optional
        The material: Young's modulus, Poisson's ratio, density. Metres, pascal and kg/m³ give seconds. All of them, or none for the API's own.
    clamped : array_like of int
        Vertices that do not move.
    progress : bool or callable
        As for `eigs`.
    **parameters
        Further ones of the job ``vibration_basis``, by the names of the API.

    Returns
    -------
    Vibration

    Examples
    --------
    >>> import chladni
    >>> bell = chladni.vibration(chladni.Mesh.sample("bell", 600), k=12, thickness=0.02, young=1.1e11, poisson=0.34, density=8800)
    >>> len(bell), bell.rigid
    (12, 6)
    """
    mesh = as_mesh(vertices, faces)
    request: dict[str, Any] = dict(parameters)
    given = {"young": young, "poisson": poisson, "density": density}
    if any(value is not None for value in given.values()):
        request["material"] = {name: _arrays.number(value, name) for name, value in given.items() if value is not None}
    if k is not None:
        request["count"] = _arrays.whole(k, "k", least=1)
    if thickness is not None:
        request["thickness"] = _arrays.number(thickness, "thickness")
    if np.size(clamped):
        request["clamped"] = _arrays.vertex_list(clamped, "clamped")[0]
    told, close = _arrays.progress_callback(progress)
    try:
        native = _native.vibration(mesh._core, json.dumps(request, default=_plain), told)
    finally:
        close()
    made = Vibration.__new__(Vibration)
    made._core, made.mesh = native, mesh
    return made
