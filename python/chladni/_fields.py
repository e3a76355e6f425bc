"""Tangential fields: spaces of them, and fields designed by strokes."""

from __future__ import annotations

import json
from typing import Any, Callable

import numpy as np

from . import _arrays, _native
from ._basis import _plain
from ._mesh import Mesh, as_mesh

__all__ = ["Fields", "fields"]


class Fields:
    """A space of tangential fields on a mesh, in which fields are designed at interactive rates: what `fields` gives.

    Attributes
    ----------
    mesh : Mesh
        The mesh.
    values : numpy.ndarray, (m,)
        Eigenvalues of the operator in the space, in 1/length² of the positions.
    dimension : int
        The number of locally supported fields that span it.
    """

    _core: _native.Fields
    mesh: Mesh

    def __init__(self) -> None:
        raise TypeError("Fields come from chladni.fields")

    @property
    def values(self) -> np.ndarray:  # noqa: D102
        return np.array(self._core.values())

    @property
    def dimension(self) -> int:  # noqa: D102
        return self._core.dimension()

    def design(
        self,
        strokes: list[dict[str, Any]] | tuple[dict[str, Any], ...] = (),
        constraints: list[dict[str, Any]] | tuple[dict[str, Any], ...] = (),
        *,
        form: str = "world",
        **request: Any,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Find the smoothest field that follows strokes and meets constraints.

        Parameters
        ----------
        strokes : list of dict
            Where the field should go along, softly: ``{"face": 17, "direction": [0, 0, 1]}``, or ``{"points": [[…], …]}``, a line to follow.
        constraints : list of dict
            What it has to be: ``{"face": 9000, "direction": [1, 0, 0]}``.
        form : {"world", "frames", "roots", "axes"}
            How the numbers of a face are written; ``"world"``: in ℝ³.
        **request
            Further members of the request of the API: ``weights``, ``alignment``, ``singularities``; ``faces``, a list of faces or ``{"sample": 3000}``, to get
            the field there alone; ``error=True`` to estimate how far the field is from the best one of the whole surface, as a share of its length;
            ``refine=1e-8`` to get that one, to this relative tolerance.

        Returns
        -------
        field : numpy.ndarray of float32, (f, 3) for vectors in the world
            A row for each face, or for each of ``faces``.
        about : dict
            Energies; ``faces`` and ``residuals``, the face and the residual of each constraint; ``error``, with ``error`` or ``refine``; ``field_faces``, with
            ``faces``: the face of each row.

        Examples
        --------
        >>> import chladni
        >>> mesh = chladni.Mesh.sample("torus", 1000)
        >>> field, about = chladni.fields(mesh, dimension=100).design([{"face": 7, "direction": [0, 0, 1]}])
        >>> field.shape == (len(mesh.faces), 3), len(about["residuals"])
        (True, 1)
        """
        text = json.dumps({"strokes": list(strokes), "constraints": list(constraints), **request}, default=_plain)
        field, about = self._core.design(text, form)
        return field, json.loads(about)

    def __repr__(self) -> str:
        return f"<chladni.Fields: {self.dimension} dimensions on {len(self.mesh.faces)} faces>"


def fields(
    vertices: Any,
    faces: Any = None,
    *,
    kind: str = "vector",
    dimension: int | None = None,
    n: int | None = None,
    seed: int = 0,
    progress: bool | Callable[[str, float], Any] = False,
    **parameters: Any,
) -> Fields:
    """Make a space of tangential fields on a mesh.

    Parameters
    ----------
    vertices, faces
        The mesh, as for `eigs`. It has to be a manifold, for fields of kind `vector` an oriented one.
    kind : {"vector", "n_vector", "tensor"}
        What lies in a face.
    dimension : int, optional
        The number of locally supported fields.
    n : int, optional
        The n of n-vectors: 4 for crosses.
    seed : int
        Seeds everything that is drawn at random.
    progress : bool or callable
        As for `eigs`.
    **parameters
        Further ones of the job ``field_basis``, by the names of the API.

    Returns
    -------
    Fields
    """
    _arrays.flag(kind, "kind", ("vector", "n_vector", "tensor"))
    mesh = as_mesh(vertices, faces)
    request: dict[str, Any] = {"field": kind, "seed": _arrays.whole(seed, "seed"), **parameters}
    if dimension is not None:
        request["dimension"] = _arrays.whole(dimension, "dimension")
    if n is not None:
        request["n"] = _arrays.whole(n, "n")
    told, close = _arrays.progress_callback(progress)
    try:
        native = _native.design_space(mesh._core, json.dumps(request, default=_plain), told)
    finally:
        close()
    made = Fields.__new__(Fields)
    made._core, made.mesh = native, mesh
    return made
