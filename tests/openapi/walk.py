"""What the README does, through the Python client that was generated from the document: python walk.py URL."""

import io
import sys
import time

import numpy as np
from chladni_client import Client
from chladni_client.api.bases import filter_, get_basis_content, get_modes, show_basis
from chladni_client.api.jobs import show_job, submit_job
from chladni_client.api.meshes import show_mesh, upload_mesh
from chladni_client import models
from chladni_client.types import File


def surface(n: int) -> bytes:
    """A curved grid of n × n vertices as OBJ."""
    lines = [f"v {i / n} {j / n} {0.2 * np.sin(4 * i / n) * np.cos(3 * j / n)}" for i in range(n) for j in range(n)]
    for i in range(n - 1):
        for j in range(n - 1):
            a, b, c, d = i * n + j + 1, (i + 1) * n + j + 1, (i + 1) * n + j + 2, i * n + j + 2
            lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    return ("\n".join(lines) + "\n").encode()


def finished(client: Client, identifier: str):
    for _ in range(60):
        job = show_job.sync(identifier, client=client, wait="20s")
        if job.status not in ("enqueued", "processing"):
            assert job.status == "succeeded", job
            return job
        time.sleep(0.1)
    raise AssertionError("the job does not end")


client = Client(base_url=sys.argv[1], raise_on_unexpected_status=True, timeout=60.0)
mesh = upload_mesh.sync(client=client, body=File(payload=io.BytesIO(surface(21))), name="a sheet")
assert isinstance(mesh, models.MeshResource), mesh
assert mesh.vertices == 441 and mesh.report.genus == 0 and mesh.report.area > 0.9
assert show_mesh.sync(mesh.id, client=client).report.boundary_loops == 1

request = models.EigenbasisJobRequest(
    kind=models.EigenbasisJobRequestKind.EIGENBASIS,
    mesh=mesh.id,
    parameters=models.EigenbasisByHsim(method=models.EigenbasisByHsimMethod.HSIM, count=12, tolerance=1e-6),
)
job = submit_job.sync(client=client, body=request)
assert isinstance(job, models.EigenbasisJobResource), job
basis = show_basis.sync(finished(client, job.id).basis, client=client)
assert isinstance(basis, models.EigenbasisBasisResource), basis
assert len(basis.eigenvalues) == 12 and basis.certificate.complete is True
assert basis.parameters.tolerance == 1e-6

content = get_basis_content.sync(basis.id, client=client)
stored = np.load(io.BytesIO(content.payload.read()))
assert np.allclose(stored["eigenvalues"], basis.eigenvalues)

modes = get_modes.sync(basis.id, client=client, from_=1, to=4, dtype=models.GetModesDtype.F64)
columns = np.load(io.BytesIO(modes.payload.read()))
assert columns.shape == (441, 3) and columns.dtype == np.float64

smooth = filter_.sync(
    basis.id,
    client=client,
    body=models.FilterRequest(
        functions=models.Named.COORDINATES,
        transfer=models.TransferLowPass(kind=models.TransferLowPassKind.LOW_PASS, cutoff=100.0),
    ),
)
assert isinstance(smooth, models.Table) and len(smooth.values) == 3 * 441
print("the walk in Python: done")
