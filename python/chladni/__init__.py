"""Spectral geometry of surfaces: eigenpairs that are proven complete, and what they are good for.

>>> import chladni
>>> mesh = chladni.Mesh.sample("sphere", 2562)
>>> basis = chladni.eigs(mesh, k=16, method="hsim")
>>> basis.complete
True
>>> basis.signatures("hks").shape
(2562, 16)

Arrays are NumPy's, matrices SciPy's. What takes long gives up the interpreter's lock; Ctrl-C ends solves, pencils, fields and distances.
"""

from ._basis import Basis
from ._certificate import Around, Certificate, CutCluster, InertiaCount, Interval, LevelReport, NearPair, OnBound
from ._client import Client, RemoteBasis
from ._errors import Cancelled, ClientError, Error, FormatError, MeshError, ParameterError, SolveError, UnprovenError
from ._fields import Fields, fields
from ._following import FollowedCluster, Following
from ._maps import CollectionMap, FunctionalMap, MapCollection, PointMap, functional_map, map_collection
from ._mesh import Mesh
from ._native import SOLVER_VERSION, __version__, get_threads
from ._operators import Operators, operators
from ._pencil import Eigenpairs, eigsh
from ._solve import eigs
from ._threads import set_threads
from ._vibration import Vibration, vibration

__all__ = [
    "SOLVER_VERSION",
    "Around",
    "Basis",
    "Cancelled",
    "Certificate",
    "Client",
    "ClientError",
    "CollectionMap",
    "CutCluster",
    "Eigenpairs",
    "Error",
    "Fields",
    "FollowedCluster",
    "Following",
    "FormatError",
    "FunctionalMap",
    "InertiaCount",
    "Interval",
    "LevelReport",
    "MapCollection",
    "Mesh",
    "MeshError",
    "NearPair",
    "OnBound",
    "Operators",
    "ParameterError",
    "PointMap",
    "RemoteBasis",
    "SolveError",
    "UnprovenError",
    "Vibration",
    "__version__",
    "eigs",
    "eigsh",
    "fields",
    "functional_map",
    "get_threads",
    "map_collection",
    "operators",
    "set_threads",
    "vibration",
]

for _name in __all__:
    _thing = globals()[_name]
    # Tracebacks and pickles name what users import.
    if getattr(_thing, "__module__", "").startswith("chladni._") and isinstance(_thing, type):
        _thing.__module__ = "chladni"
del _name, _thing
