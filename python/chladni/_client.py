"""The same on a server: meshes go up, jobs run there, and a basis answers as a local one does."""

from __future__ import annotations

import io
import json
import urllib.error
import urllib.parse
import urllib.request
import uuid
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Callable, cast

import numpy as np

from . import _arrays, _native, _pencil
from ._basis import Basis
from ._certificate import Certificate
from ._errors import Cancelled, ClientError, Error, ParameterError, SolveError, UnprovenError
from ._maps import MapCollection, collection_request
from ._mesh import Mesh, as_mesh
from ._solve import eigenbasis_request

__all__ = ["Client", "RemoteBasis"]

_JSON, _OCTETS = "application/json", "application/octet-stream"

#: How long one answer about a running job is waited for.
_WAIT = 2


class Client:
    """A server of Chladni.

    Parameters
    ----------
    url : str
        Where it listens.
    key : str, optional
        The secret of an API key, where the server wants one.
    timeout : float
        Seconds to wait for an answer.

    Examples
    --------
    >>> import chladni
    >>> client = chladni.Client("http://127.0.0.1:8080")                  # doctest: +SKIP
    >>> basis = client.eigs(mesh, k=200, method="hsim")                   # doctest: +SKIP
    >>> basis.signatures("hks")                                           # doctest: +SKIP
    """

    def __init__(self, url: str = "http://127.0.0.1:8080", key: str | None = None, *, timeout: float = 60.0) -> None:
        if urllib.parse.urlsplit(url).scheme not in ("http", "https"):
            raise _arrays.parameter_error(f"url must begin with http:// or https://, got {url!r}")
        if key and not (key.isascii() and key.isprintable()):
            raise _arrays.parameter_error("key must have only ASCII letters, digits and punctuation, since it is sent in a header")
        self.url, self.timeout = url.rstrip("/"), float(timeout)
        self._headers = {"Authorization": f"Bearer {key}"} if key else {}

    def call(
        self,
        method: str,
        path: str,
        *,
        query: dict[str, Any] | None = None,
        body: Any = None,
        content_type: str = _JSON,
        accept: str | None = None,
    ) -> tuple[bytes, Any]:
        """Call the API: what the other methods do.

        Parameters
        ----------
        method, path : str
            ``"GET"`` and ``"/v1/meshes"``, for example.
        query : dict, optional
            Members that are None are left out.
        body : bytes or what JSON can write, optional
        content_type, accept : str
            Media types.

        Returns
        -------
        content : bytes
        headers : mapping

        Raises
        ------
        ClientError
            With the sentence of the server's problem, its `status` and its `code`.
        """
        given = {name: value for name, value in (query or {}).items() if value is not None}
        address = self.url + path + ("?" + urllib.parse.urlencode(given) if given else "")
        headers = dict(self._headers)
        if body is not None:
            headers["Content-Type"] = content_type
            if not isinstance(body, (bytes, bytearray, memoryview)):
                body = json.dumps(body).encode()
        if accept:
            headers["Accept"] = accept
        request = urllib.request.Request(address, data=body, headers=headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=self.timeout) as answer:
                return answer.read(), answer.headers
        except urllib.error.HTTPError as error:
            raise _client_error(error.code, error.read()) from None
        except (urllib.error.URLError, TimeoutError, ConnectionError) as error:
            raise _client_error(0, f"{self.url} does not answer: {getattr(error, 'reason', error)}".encode()) from None

    def _json(self, method: str, path: str, **arguments: Any) -> Any:
        return json.loads(self.call(method, path, **arguments)[0])

    def upload(self, vertices: Any, faces: Any = None) -> str:
        """Bring a mesh to the server.

        Parameters
        ----------
        vertices, faces
            The mesh, as for `chladni.eigs`.

        Returns
        -------
        str
            Its identifier: that of its content, so that a mesh is kept once.
        """
        mesh = as_mesh(vertices, faces)
        merged = any(repair["kind"] == "merged_vertices" for repair in mesh.report["repairs"])
        file = io.BytesIO()
        np.savez(file, vertices=mesh.vertices, faces=mesh.faces)
        query = {"format": "npz", "merge": "always" if merged else "never", "subdivide": mesh.report.get("subdivisions") or None}
        made = self._json("POST", "/v1/meshes", query=query, body=file.getvalue(), content_type="application/x-npz")
        return str(made["id"])

    def eigs(
        self,
        vertices: Any,
        faces: Any = None,
        k: int | None = None,
        *,
        progress: bool | Callable[[str, float], Any] = False,
        **arguments: Any,
    ) -> RemoteBasis:
        """Lowest eigenpairs of an operator on a mesh, computed by the server: arguments are those of `chladni.eigs`.

        Ctrl-C cancels the job.

        Returns
        -------
        RemoteBasis
        """
        mesh = as_mesh(vertices, faces)
        parameters = eigenbasis_request(k, **arguments)
        wanted = {"kind": "eigenbasis", "mesh": self.upload(mesh), "parameters": json.loads(parameters)}
        job = self._json("POST", "/v1/jobs", body=wanted)
        return self.basis(self._finished(job, progress)["basis"], mesh)

    def problem(self, S: Any, M: Any = None, name: str | None = None) -> str:
        """Bring the matrices of a pencil to the server.

        Parameters
        ----------
        S, M
            The matrices, as for `chladni.eigsh`.
        name : str, optional
            A name for people.

        Returns
        -------
        str
            Its identifier: that of its content, so that equal matrices are kept once.
        """
        import scipy.sparse

        stiffness = _pencil._csr(S, "S")
        parts = {"stiffness": _npz(stiffness)}
        diagonal, mass = _pencil._mass(M, stiffness.shape[0])
        if mass is not None:
            parts["mass"] = _npz(mass)
        elif diagonal is not None:
            parts["mass"] = _npz(scipy.sparse.diags(diagonal).tocsr())
        boundary = uuid.uuid4().hex
        head = "--{}\r\nContent-Disposition: form-data; name=\"{}\"; filename=\"{}.npz\"\r\n\r\n"
        body = b"".join(head.format(boundary, part, part).encode() + content + b"\r\n" for part, content in parts.items())
        body += f"--{boundary}--\r\n".encode()
        kind = f"multipart/form-data; boundary={boundary}"
        return str(self._json("POST", "/v1/problems", query={"name": name}, body=body, content_type=kind)["id"])

    def eigsh(
        self,
        S: Any,
        k: int | None = None,
        M: Any = None,
        sigma: float | None = None,
        which: str | None = None,
        *,
        tol: float = 1e-8,
        below: float | None = None,
        between: tuple[float, float] | None = None,
        fixed: Any = (),
        seed: int = 0,
        at_most: int | None = None,
        return_eigenvectors: bool = True,
        progress: bool | Callable[[str, float], Any] = False,
    ) -> Any:
        """Lowest eigenpairs of ``S x = λ M x``, computed by the server: arguments are those of `chladni.eigsh`, and `at_most`.

        `S` may also be the identifier that `problem` returned; `M` then belongs to it. Ctrl-C cancels the job.

        Parameters
        ----------
        at_most : int, optional
            With `sigma`, `below` or `between`: the most pairs that the server may compute, up to 20,000; it sets memory aside for as many. Where it is not
            given, `k` takes its place with `below` and `between`, and otherwise the server allows 1000. More are an error.

        Returns
        -------
        Eigenpairs or numpy.ndarray, (k,)
        """
        _pencil._check_wanted(sigma, which, tol, below, between)
        if isinstance(S, str) and M is not None:
            raise _arrays.parameter_error("S is the identifier of a problem, which has its own mass: M belongs to matrices")
        identifier = S if isinstance(S, str) else self.problem(S, M)
        rows, _ = _arrays.vertex_list(fixed, "fixed", "row") if np.size(fixed) else ([], False)
        parameters: dict[str, Any] = {"tolerance": _arrays.number(tol, "tol") or _pencil._LEAST, "seed": _arrays.whole(seed, "seed"), "precision": "f64"}
        parameters["fixed"] = [int(row) for row in rows]
        if below is not None:
            parameters["below"] = float(below)
        if between is not None:
            parameters["between"] = [float(end) for end in between]
        if sigma is not None:
            parameters["around"] = float(sigma)
        if below is None and between is None:
            parameters["count"] = 6 if k is None else _arrays.whole(k, "k", least=1)
        elif at_most is None:
            at_most = k
        if at_most is not None:
            parameters["at_most"] = _arrays.whole(at_most, "k" if at_most is k else "at_most")
        job = self._json("POST", "/v1/jobs", body={"kind": "pencil_basis", "pencil": identifier, "parameters": parameters})
        job = self._finished(job, progress)
        record = self._json("GET", f"/v1/bases/{job['basis']}")
        values = np.array(record["eigenvalues"], dtype=float)
        if not return_eigenvectors:
            return values
        if len(values):
            content, _ = self.call("GET", f"/v1/bases/{job['basis']}/modes", query={"format": "npy", "dtype": "f64"})
            vectors = np.load(io.BytesIO(content))
        else:
            # A range of no functions is refused.
            vectors = np.empty((int(record["rows"]), 0))
        certificate = Certificate._of_json(json.dumps(record["certificate"]))
        return _pencil.Eigenpairs(values, vectors, certificate, float(record["details"]["moved"]))

    def map_collection(
        self,
        bases: Sequence[RemoteBasis | str],
        *,
        progress: bool | Callable[[str, float], Any] = False,
        **arguments: Any,
    ) -> MapCollection:
        """Map all shapes of a collection to each other, by the server: arguments are those of `chladni.map_collection`.

        What is found is kept there. Ctrl-C cancels the job.

        Parameters
        ----------
        bases : sequence of RemoteBasis or str
            Bases that the server has, or their identifiers, each of another mesh.

        Returns
        -------
        MapCollection
        """
        named = [basis if isinstance(basis, str) else basis.id for basis in bases]
        given = {name: value for name, value in collection_request(**arguments).items() if value is not None}
        job = self._json("POST", "/v1/jobs", body={"kind": "map_collection", "bases": named, "parameters": given})
        return self.maps(self._finished(job, progress)["basis"])

    def maps(self, identifier: str) -> MapCollection:
        """Maps between shapes that the server has: what `map_collection` made once.

        Parameters
        ----------
        identifier : str
            The `basis` of the job.

        Returns
        -------
        MapCollection
        """
        content, _ = self.call("GET", f"/v1/bases/{urllib.parse.quote(identifier)}/content", query={"format": "npz"})
        with np.load(io.BytesIO(content)) as arrays:
            if "disagreements" not in arrays:
                raise _arrays.parameter_error(f"{identifier} is a basis, not a collection of maps")
            return MapCollection._of_npz(arrays)

    def _finished(self, job: Any, progress: bool | Callable[[str, float], Any]) -> Any:
        """The job when it has succeeded; an interruption cancels it."""
        told, close = _arrays.progress_callback(progress)
        try:
            while job["status"] in ("enqueued", "processing"):
                if told:
                    told(job.get("stage") or job["status"], float(job.get("progress") or 0.0))
                job = self._json("GET", f"/v1/jobs/{job['id']}", query={"wait": f"{_WAIT}s"})
        except BaseException:
            self._cancel(job["id"])
            raise
        finally:
            close()
        if job["status"] != "succeeded":
            raise _job_error(job)
        return job

    def _cancel(self, job: str) -> None:
        try:
            self.call("POST", f"/v1/jobs/{job}/cancel")
        except Error:
            pass

    def basis(self, identifier: str, mesh: Mesh | None = None) -> RemoteBasis:
        """A basis that the server has.

        Parameters
        ----------
        identifier : str
            Its identifier.
        mesh : Mesh, optional
            The mesh that it lives on, where that is at hand.

        Returns
        -------
        RemoteBasis
        """
        return RemoteBasis._of(cast("_native.Basis", _RemoteNative(self, identifier)), mesh)


class RemoteBasis(Basis):
    """A basis on a server, with the methods of `Basis`: what `Client.eigs` and `Client.basis` give.

    Attributes
    ----------
    id : str
        Its identifier there.
    """

    @property
    def id(self) -> str:  # noqa: D102
        return cast(_RemoteNative, self._core).id

    def download(self) -> Basis:
        """The same basis, here.

        Returns
        -------
        Basis
        """
        content = bytes(self._core.to_bytes())
        mesh = self.mesh
        maps = None if mesh is not None else (self.vertex_map.astype(np.int32), np.empty(0, dtype=np.int32))
        return Basis._of(_native.Basis.of_bytes(content, None if mesh is None else mesh._core, maps), mesh)

    def loss_gradient(self, weights: Any, functions: Any) -> np.ndarray:
        """The gradient of a loss by positions, as `Basis.loss_gradient`: computed here, of the basis as it is downloaded, which needs its mesh."""
        if self.mesh is None:
            raise _arrays.parameter_error("the gradient of a loss is computed here and needs the mesh: client.basis(identifier, mesh)")
        return self.download().loss_gradient(weights, functions)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.download().__reduce__()


class _RemoteNative:
    """What the native module's basis can do, by way of the server."""

    def __init__(self, client: Client, identifier: str) -> None:
        self.client, self.id = client, identifier

    @cached_property
    def record(self) -> dict[str, Any]:
        found: dict[str, Any] = self.client._json("GET", f"/v1/bases/{urllib.parse.quote(self.id)}")
        return found

    @cached_property
    def _maps(self) -> np.ndarray:
        return self._npy(f"/v1/meshes/{self.record['mesh']}/vertex-map", format="npy")

    def _npy(self, path: str, **query: Any) -> np.ndarray:
        array: np.ndarray = np.load(io.BytesIO(self.client.call("GET", path, query=query)[0]))
        return array

    def _table(self, what: str, body: Any, content_type: str = _JSON, **query: Any) -> np.ndarray:
        path = f"/v1/bases/{self.id}/{what}"
        query = {"dtype": "f64", **query}
        content, headers = self.client.call("POST", path, query=query, body=body, content_type=content_type, accept=_OCTETS)
        rows, columns = int(headers["Chladni-Rows"]), int(headers["Chladni-Columns"])
        return np.frombuffer(bytearray(content), dtype="<f8").reshape(rows, columns)

    @staticmethod
    def _raw(functions: np.ndarray) -> bytes:
        # A vertex that was dropped has no value; the server takes none from it, and wants a number.
        return np.ascontiguousarray(functions, dtype="<f8").tobytes()

    def values(self) -> np.ndarray:
        return np.array(self.record["eigenvalues"])

    def shape(self) -> tuple[int, int]:
        return (int(self.record["rows"]) if self.of_fields() else len(self._maps)), len(self.record["eigenvalues"])

    def dimension(self) -> int | None:
        return self.record.get("dimension")

    def of_fields(self) -> bool:
        return "hodge" in (self.record.get("operator") or {})

    def vertex_map(self) -> np.ndarray:
        return self._maps.astype(np.int64)

    def certificate(self) -> str:
        return json.dumps(self.record.get("certificate") or {"orthonormality_defect": float("nan")})

    def metadata(self) -> str:
        return json.dumps({"parameters": self.record.get("parameters") or {}, "operator": self.record.get("operator")})

    def seconds(self) -> list[tuple[str, float]]:
        return []

    def vectors(self, start: int, stop: int, nearest: bool) -> np.ndarray:
        query = {"from": start, "to": stop, "dtype": "f64", "extend": _extend(nearest)}
        return np.asfortranarray(self._npy(f"/v1/bases/{self.id}/modes", **query))

    @cached_property
    def _whole(self) -> _native.Basis:
        return _native.Basis.of_bytes(self.to_bytes(), None, None)

    def mass(self) -> Any:
        return self._whole.mass()

    def to_bytes(self) -> bytes:
        return self.client.call("GET", f"/v1/bases/{self.id}/content", query={"format": "npz"})[0]

    def write(self, path: str) -> None:
        content = self.to_bytes()
        with open(path, "wb") as file:
            file.write(content)

    def signatures(self, kind: str, times: Any, count: Any, normalised: bool, vertices: Any, nearest: bool) -> np.ndarray:
        name = {"hks": "heat_kernel", "wks": "wave_kernel", "gps": "global_point"}[kind]
        signature: dict[str, Any] = {"kind": name}
        if kind == "hks":
            signature["normalised"] = normalised
            if times is not None:
                signature["times"] = times
        if count is not None:
            signature["count"] = count
        request = {"signature": signature, **({} if vertices is None else {"vertices": vertices})}
        return self._table("signatures", request, extend=_extend(nearest))

    def distances(self, request: str, nearest: bool) -> np.ndarray:
        return self._table("distances", request.encode(), extend=_extend(nearest))

    def filter(self, functions: np.ndarray, transfer: str, nearest: bool) -> np.ndarray:
        return self._table("filter", self._raw(functions), _OCTETS, transfer=transfer, extend=_extend(nearest))

    def project(self, functions: np.ndarray) -> np.ndarray:
        return self._table("project", self._raw(functions), _OCTETS)

    def value_gradient(self, weights: list[float]) -> np.ndarray:
        return self._table("value-gradient", np.asarray(weights, dtype="<f8").tobytes(), _OCTETS)

    def follow(self, other: _RemoteNative, pairs: int | None, gap: float) -> str:
        if other.client.url != self.client.url:
            raise _arrays.parameter_error(f"other is on {other.client.url}, and this basis on {self.client.url}")
        request = {"reference": self.id, "other": other.id, "pairs": pairs, "gap": gap, "following": True}
        return json.dumps(self.client._json("POST", "/v1/basis-comparisons", body=request)["following"])

    def reconstruct(self, coefficients: np.ndarray, nearest: bool) -> np.ndarray:
        return self._table("reconstruct", self._raw(coefficients), _OCTETS, extend=_extend(nearest))


def _npz(matrix: Any) -> bytes:
    """A sparse matrix as the bytes of an NPZ file."""
    import scipy.sparse

    file = io.BytesIO()
    scipy.sparse.save_npz(file, matrix, compressed=False)
    return file.getvalue()


def _extend(nearest: bool) -> str:
    return "nearest" if nearest else "none"


def _client_error(status: int, content: bytes) -> ClientError:
    try:
        problem = json.loads(content)
    except ValueError:
        problem = {}
    if not isinstance(problem, dict):
        problem = {}
    error = ClientError(problem.get("detail") or problem.get("title") or content.decode(errors="replace")[:500] or f"status {status}")
    error.status, error.problem = status, problem
    error.code = _code_of(problem.get("type", "error"))
    return error


def _code_of(kind: Any) -> str:
    """The identifier in the type of a problem, less what it says of the parameter: ``/problems/invalid-parameters/count``."""
    return str(kind).partition("/problems/")[2].split("/")[0] or str(kind)


def _job_error(job: dict[str, Any]) -> Error:
    problem = job.get("problem") or {}
    code = _code_of(problem.get("type") or job["status"])
    kind: type[Error] = SolveError
    if job["status"] == "canceled":
        kind = Cancelled
    elif code in ("invalid-parameter", "invalid-parameters"):
        kind = ParameterError
    elif code in ("not-converged", "incomplete", "unproven", "tolerance-below-rounding"):
        kind = UnprovenError
    error = kind(problem.get("detail") or f"the job is {job['status']}")
    error.code = code
    return error
