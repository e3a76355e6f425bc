"""What learning pipelines keep of a surface: Laplacian, mass, eigenpairs, gradients, and frames.

The layout is that of the caches of DiffusionNet (Sharp, Attaiki, Crane and Ovsjanikov 2022), so that `Operators.save_cache` writes what its
``get_operators(…, op_cache_dir=…)`` reads.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable

import numpy as np

from . import _arrays, _native
from ._certificate import Certificate
from ._mesh import as_mesh
from ._solve import eigs

if TYPE_CHECKING:
    import scipy.sparse

__all__ = ["Operators", "operators"]

#: What is added to the mass of each vertex, as a share of the mean mass: vertices that no face uses have some.
_LEAST_MASS = 1e-8


@dataclass(frozen=True, eq=False)
class Operators:
    """What a network on a surface needs of it, in the order of the fields.

    Attributes
    ----------
    frames : numpy.ndarray, (n, 3, 3)
        At each vertex two tangents and the normal, as rows.
    mass : numpy.ndarray, (n,)
        The lumped mass.
    L : scipy.sparse.csc_matrix, (n, n)
        The stiffness matrix: the weak Laplacian, positive semi-definite.
    evals : numpy.ndarray, (k,)
        Eigenvalues of ``L x = λ M x``, ascending, none below zero.
    evecs : numpy.ndarray, (n, k)
        Eigenvectors, orthonormal for the mass; zero at vertices that no face uses.
    gradX, gradY : scipy.sparse.csc_matrix, (n, n)
        Components of the gradient of a function, in the frame of each vertex.
    certificate : Certificate
        What is proven about the eigenpairs.
    vertices : numpy.ndarray, (n, 3)
        The positions, of the type that they were given in.
    faces : numpy.ndarray, (f, 3)
        The triangles, of the type that they were given in.
    """

    frames: np.ndarray
    mass: np.ndarray
    L: scipy.sparse.csc_matrix
    evals: np.ndarray
    evecs: np.ndarray
    gradX: scipy.sparse.csc_matrix
    gradY: scipy.sparse.csc_matrix
    certificate: Certificate
    vertices: np.ndarray
    faces: np.ndarray

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything as the arrays of a cache, by their names there, in single precision."""
        single = np.float32
        members: dict[str, Any] = {
            "verts": self.vertices,
            "frames": self.frames.astype(single),
            "faces": self.faces,
            "k_eig": np.asarray(len(self.evals)),
            "mass": self.mass.astype(single),
            **_sparse_members("L", self.L),
            "evals": self.evals.astype(single),
            "evecs": np.ascontiguousarray(self.evecs, dtype=single),
            **_sparse_members("gradX", self.gradX),
            **_sparse_members("gradY", self.gradY),
        }
        return members

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one NPZ file. It appears under its name when it is whole.

        Parameters
        ----------
        path : path
            The file.
        """
        folder, name = os.path.split(os.fspath(path))
        handle, beside = tempfile.mkstemp(dir=folder or ".", prefix=f".{name}.", suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, **self.arrays())  # type: ignore[arg-type]
            # Temporary files are for their owner alone; a cache is often shared.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(beside, 0o666 & ~mask)
            os.replace(beside, path)
        except BaseException:
            os.unlink(beside)
            raise

    def save_cache(self, folder: str | os.PathLike[str]) -> str:
        """Write the file of this mesh in a cache folder of DiffusionNet.

        Its name is made of a hash of positions and faces, types included: the arrays have to be those that the network will be given. DiffusionNet's data sets
        have positions in float32 and faces in int64.

        Parameters
        ----------
        folder : path
            The folder; made where there is none.

        Returns
        -------
        str
            The path of the file.
        """
        os.makedirs(folder, exist_ok=True)
        digest = hashlib.sha1()
        for array in (self.vertices, self.faces):
            digest.update(np.ascontiguousarray(array).tobytes())
        path = os.path.join(os.fspath(folder), f"{digest.hexdigest()}_0.npz")
        self.save(path)
        return path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Operators:
        """Read a file of `save`, of `save_cache`, or of DiffusionNet's cache. Nothing is proven about pairs that come from a file.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        Operators
            In single precision.
        """
        with np.load(path) as members:
            nothing = np.empty(0)
            return cls(
                frames=members["frames"],
                mass=members["mass"],
                L=_sparse_of("L", members),
                evals=members["evals"],
                evecs=members["evecs"],
                gradX=_sparse_of("gradX", members),
                gradY=_sparse_of("gradY", members),
                certificate=Certificate(nothing, nothing, nothing, float("nan")),
                vertices=members["verts"],
                faces=members["faces"],
            )


def _sparse_members(name: str, matrix: scipy.sparse.csc_matrix) -> dict[str, np.ndarray]:
    return {
        f"{name}_data": matrix.data.astype(np.float32),
        f"{name}_indices": matrix.indices,
        f"{name}_indptr": matrix.indptr,
        f"{name}_shape": np.asarray(matrix.shape),
    }


def _sparse_of(name: str, members: Any) -> scipy.sparse.csc_matrix:
    import scipy.sparse

    parts = tuple(members[f"{name}_{part}"] for part in ("data", "indices", "indptr"))
    return scipy.sparse.csc_matrix(parts, shape=tuple(members[f"{name}_shape"]))


def operators(
    vertices: Any,
    faces: Any = None,
    k: int = 128,
    *,
    operator: str = "auto",
    tol: float = 1e-6,
    regularisation: float = 1e-5,
    seed: int = 0,
    progress: bool | Callable[[str, float], Any] = False,
) -> Operators:
    """Compute what networks on surfaces need: frames, mass, Laplacian, eigenpairs, gradients.

    Parameters
    ----------
    vertices, faces
        The mesh, as for `eigs`.
    k : int
        How many eigenpairs; fewer where the mesh has fewer vertices.
    operator : {"auto", "laplace", "polygon", "robust"}
        The Laplacian: by cotangents as they are, of the polygons, the robust one, or whichever the mesh calls for.
    tol : float
        The largest residual of an eigenpair. Results are kept in single precision as a rule, which 1e-6 is enough for.
    regularisation : float
        What is added to the normal equations of the gradients, in squared units of the positions, so that a single edge suffices.
    seed : int
        Seeds everything that is drawn at random.
    progress : bool or callable
        As for `eigs`.

    Returns
    -------
    Operators

    Examples
    --------
    >>> import chladni
    >>> found = chladni.operators(chladni.Mesh.sample("sphere", 1002), k=16)
    >>> found.frames.shape, found.evecs.shape, found.gradX.shape, found.certificate.complete
    ((1002, 3, 3), (1002, 16), (1002, 1002), True)

    The gradient of a height is its slope along either tangent:

    >>> import numpy
    >>> slope = numpy.hypot(found.gradX @ found.vertices[:, 2], found.gradY @ found.vertices[:, 2])
    >>> bool(abs(slope - numpy.sqrt(1 - found.vertices[:, 2] ** 2)).max() < 0.03)
    True
    """
    import scipy.sparse

    _arrays.flag(operator, "operator", ("auto", "laplace", "polygon", "robust"))
    mesh = as_mesh(vertices, faces)
    if mesh.report.get("points"):
        raise _arrays.parameter_error("operators need a surface with faces, and the mesh has only points")
    size = len(mesh.vertices)
    if int(mesh.report.get("subdivisions", 0)) or any(repair["kind"] == "merged_vertices" for repair in mesh.report["repairs"]):
        raise _arrays.parameter_error(
            "vertices were merged or added, so rows would not match the mesh; use Mesh(mesh.kept_vertices, mesh.kept_faces)"
        )
    S, M = mesh.laplacian(operator)
    pairs = min(_arrays.whole(k, "k", least=1), len(mesh.kept_vertices))
    basis = eigs(mesh, k=pairs, method="hsim", tol=tol, operator=operator, seed=seed, progress=progress)
    frames, offsets, indices, values = _native.gradients(mesh.vertices, mesh.faces, float(regularisation))
    gradients = [
        scipy.sparse.csr_matrix((np.ascontiguousarray(values[:, axis]), indices, offsets), shape=(size, size)).tocsc() for axis in (0, 1)
    ]
    mass = M.diagonal()
    own = np.asarray(vertices) if faces is not None else mesh.vertices
    return Operators(
        frames=frames,
        mass=mass + _LEAST_MASS * mass.mean(),
        L=S.tocsc(),
        evals=np.maximum(basis.values, 0.0),
        evecs=np.nan_to_num(basis.vectors, copy=False, nan=0.0),
        gradX=gradients[0],
        gradY=gradients[1],
        certificate=basis.certificate,
        vertices=own if own.shape == mesh.vertices.shape else mesh.vertices,
        faces=np.asarray(faces) if faces is not None else mesh.faces,
    )
