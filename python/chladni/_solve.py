"""Eigenpairs of operators on meshes."""

from __future__ import annotations

import json
from typing import Any, Callable


from . import _arrays
from ._basis import Basis, _plain
from ._mesh import as_mesh

#: The residual that `eigs` asks the exact methods for, where nothing is said.
TOLERANCE = 1e-8


def eigs(
    vertices: Any,
    faces: Any = None,
    k: int | None = None,
    *,
    method: str = "auto",
    operator: str | dict[str, Any] = "auto",
    mass: str = "barycentric",
    boundary: str = "neumann",
    tol: float | None = None,
    below: float | None = None,
    between: tuple[float, float] | None = None,
    seed: int = 0,
    progress: bool | Callable[[str, float], Any] = False,
    **parameters: Any,
) -> Basis:
    """Lowest eigenpairs of an operator on a mesh.

    Parameters
    ----------
    vertices : Mesh or array_like, (n, 3)
        The mesh, or its positions; objects of other libraries as for `Mesh`.
    faces : array_like of int, (f, 3), optional
        Its triangles.
    k : int, optional
        How many pairs, the kernel included; 50 by default. With `below` or `between` the most that may be delivered (more are an error).
    method : {"auto", "hsim", "approximate", "sim"}
        ``"hsim"``: to a tolerance, proven complete. ``"approximate"``: Ritz pairs in a space of locally supported functions, each with an estimate of its error, a
        percent at most; in seconds where exact pairs take minutes. ``"auto"``: the exact method where that takes about a second or less, the approximation
        otherwise; arguments that belong to one of them choose it. ``"sim"``: plain subspace iteration, a baseline.
    operator : str or dict
        ``"auto"`` (the Laplacian by cotangents, that of the polygons or the robust one where the mesh calls for it), ``"laplace"``, ``"polygon"``, ``"robust"``, ``"hodge"`` (tangential fields, two rows
        for each face), ``"graph"``, ``"volume"`` (of a solid), ``{"extrinsic": {"t": …}}``, ``{"hamiltonian": {"potential": {"values": …}}}`` with a
        value for each vertex, or ``{"hamiltonian": {"potential": {"curvature": {"t": …}}}}``.
    mass : {"barycentric", "voronoi", "consistent"}
        The mass matrix.
    boundary : {"neumann", "dirichlet", "tangential", "normal"}
        What holds at the boundary of the surface: the first two of functions, the other two of the fields of ``"hodge"``, which run along it or across it.
    tol : float, optional
        The largest residual ``‖S x − θ M x‖ / ‖S x‖`` of a pair, 1e-10 to 0.5; chooses ``"hsim"``. Where nothing is said, `method` ``"hsim"`` has 1e-8; ``"auto"`` has 1e-2, by
        which eigenvalues are right to some 1e-4.
    below : float, optional
        All pairs whose eigenvalue lies below this, in 1/length² of the positions.
    between : (float, float), optional
        All pairs whose eigenvalue is at least the first and below the second.
    seed : int
        Seeds everything that is drawn at random: same seed, same answer.
    progress : bool or callable
        Draw a bar (where tqdm is installed), or call with the stage and the fraction of it that is done.
    **parameters
        Further ones of the job ``eigenbasis``, by the names of the API: ``dimension``, ``accuracy="accurate"``, ``storage="compact"``, ``certify``, ….

    Returns
    -------
    Basis

    Raises
    ------
    MeshError, ParameterError
        What cannot be used, by its name and number.
    UnprovenError
        The pairs did not converge, or could not be proven complete.
    KeyboardInterrupt
        Ctrl-C ends the work within a tenth of a second or so.

    Examples
    --------
    >>> import chladni
    >>> mesh = chladni.Mesh.sample("torus", 2000)
    >>> basis = chladni.eigs(mesh, k=20, method="hsim")
    >>> basis.vectors.shape == (len(mesh.vertices), 20), basis.complete, bool(basis.residuals.max() <= 1e-8)
    (True, True, True)
    >>> bool(len(chladni.eigs(mesh, below=2.0)) == (chladni.eigs(mesh, k=30).values < 2.0).sum())
    True
    """
    mesh = as_mesh(vertices, faces)
    request = eigenbasis_request(
        k,
        method=method,
        operator=operator,
        mass=mass,
        boundary=boundary,
        tol=tol,
        below=below,
        between=between,
        seed=seed,
        **parameters,
    )
    told, close = _arrays.progress_callback(progress)
    try:
        native = mesh._core.eigenbasis(request, told)
    finally:
        close()
    return Basis._of(native, mesh)


def eigenbasis_request(
    k: int | None = None,
    *,
    method: str = "auto",
    operator: str | dict[str, Any] = "auto",
    mass: str = "barycentric",
    boundary: str = "neumann",
    tol: float | None = None,
    below: float | None = None,
    between: tuple[float, float] | None = None,
    seed: int = 0,
    **parameters: Any,
) -> str:
    """The parameters of a job ``eigenbasis`` as JSON, of the arguments of `eigs`."""
    _arrays.flag(method, "method", ("auto", "hsim", "approximate", "sim"))
    request: dict[str, Any] = {"method": method, "operator": operator, "mass": mass, "boundary": boundary, "seed": _arrays.whole(seed, "seed"), **parameters}
    interval = below is not None or between is not None
    if below is not None:
        request["below"] = _arrays.number(below, "below")
    if between is not None:
        request["between"] = [_arrays.number(end, "between") for end in between]
    if interval and k is not None:
        request["at_most"] = _arrays.whole(k, "k", least=1)
    elif not interval:
        request["count"] = 50 if k is None else _arrays.whole(k, "k", least=1)
    exact = method in ("hsim", "sim") or (method == "auto" and (interval or operator in ("hodge", "graph")))
    if tol is None and exact:
        tol = TOLERANCE
    if tol is not None:
        request["tolerance"] = _arrays.number(tol, "tol")
        if request.get("storage", "dense") == "dense" and method != "approximate":
            request.setdefault("precision", "f64")
    return json.dumps(request, default=_plain)
