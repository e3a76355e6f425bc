"""The same on a server: answers are those of here. Needs the binary, as ``CHLADNI_BINARY``."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import chladni


@pytest.fixture(scope="module")
def client(server):
    return chladni.Client(server)


def test_answers_are_those_of_here(client, knot, tmp_path):
    vertices = np.concatenate([[[7.0, 7, 7]], knot.vertices])
    arguments = {"vertices": vertices, "faces": knot.faces + 1, "k": 30, "method": "hsim"}
    here, there = chladni.eigs(**arguments), client.eigs(**arguments)
    assert np.allclose(there.values, here.values, atol=1e-9) and there.shape == here.shape and there.complete
    assert np.allclose(abs(there.lift(0, 5)), abs(here.lift(0, 5)), atol=1e-6, equal_nan=True)
    assert np.allclose(there.mass, here.mass) and np.array_equal(there.vertex_map, here.vertex_map)
    assert np.allclose(there.signatures("wks"), here.signatures("wks"), atol=1e-6, equal_nan=True)
    assert np.allclose(there.signatures("hks", times=[1.0], vertices=[5]), here.signatures("hks", times=[1.0], vertices=[5]))
    for kind, times in [("biharmonic", None), ("diffusion", [0.5, 1.0]), ("geodesic", None)]:
        assert np.allclose(there.distances([5, 9], kind, times=times), here.distances([5, 9], kind, times=times), atol=1e-6, equal_nan=True)
    assert np.allclose(there.filter(vertices, "heat", time=0.2), here.filter(vertices, "heat", time=0.2), atol=1e-6, equal_nan=True)
    spectrum = here.project(vertices[:, 0])
    assert np.allclose(there.project(vertices[:, 0]) ** 2, spectrum**2, atol=1e-5)
    assert np.allclose(there.reconstruct(there.project(vertices)), here.reconstruct(here.project(vertices)), atol=1e-6, equal_nan=True)
    onward = there.follow(client.basis(there.id), 10)
    assert np.array_equal(onward.modes, np.arange(10)) and np.allclose(onward.rotation, here.follow(here, 10).rotation, atol=1e-6)
    with pytest.raises(chladni.ParameterError, match="on the same server"):
        there.follow(here)
    local = there.download()
    assert type(local) is chladni.Basis and np.array_equal(local.values, there.values)
    there.save(tmp_path / "there.npz")
    assert chladni.Basis.load(tmp_path / "there.npz").shape == here.shape
    weights = [0.0, 1.0, 0.5]
    assert np.allclose(there.value_gradient(weights), here.value_gradient(weights), atol=1e-6)
    again = client.basis(there.id)
    with pytest.raises(chladni.ParameterError, match="needs the mesh"):
        again.loss_gradient(weights, np.zeros((len(vertices), 1)))
    assert np.array_equal(again.values, there.values) and again.shape == here.shape
    assert client.upload(vertices, knot.faces + 1) == client.upload(vertices, knot.faces + 1)


def test_maps_of_a_collection_are_those_of_here(client):
    mesh = chladni.Mesh.sample("sphere", 400)
    x, y, z = mesh.vertices.T
    # Without symmetries, since maps of symmetric shapes hang on rounding.
    bumps = np.stack([x, 1.35 * y, 1.8 * z], -1) * (1 + 0.25 * x + 0.2 * y * z + 0.15 * (x * x - 0.5 * y))[:, None]
    # A vertex that nothing uses, so that the numbers of the file are not those of the mesh.
    bent = [(np.concatenate([[[9.0, 9, 9]], bumps * [1.0, 1.0, scale]]), mesh.faces + 1) for scale in (1.0, 1.02, 1.05)]
    arguments = {"pairs": 40, "start": 20, "step": 10, "samples": 300}
    bases = [client.eigs(*one, k=50, method="hsim", tol=1e-8) for one in bent]
    there = client.map_collection(bases, **arguments)
    here = chladni.map_collection([basis.download() for basis in bases], **arguments)
    assert there.maps.keys() == here.maps.keys() and there.pairs_error == pytest.approx(here.pairs_error)
    for pair, own in here.maps.items():
        other = there.maps[pair]
        assert np.array_equal(other.to_source.points, own.to_source.points) and other.to_source.points[0] == -1
        assert np.allclose(other.matrix, own.matrix) and other.disagreement == pytest.approx(own.disagreement)
        assert np.allclose(other.to_source.confidences, own.to_source.confidences, equal_nan=True)
    with pytest.raises(chladni.ClientError, match="duplicates"):
        client.map_collection([bases[0], bases[0].id])
    with pytest.raises(chladni.ParameterError, match="not a collection of maps"):
        client.maps(bases[0].id)


def test_pairs_of_matrices_are_those_of_here(client):
    import scipy.sparse

    n = 300
    S = scipy.sparse.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1]).tocsr()
    M = scipy.sparse.diags([np.ones(n - 1), 4 * np.ones(n), np.ones(n - 1)], [-1, 0, 1]).tocsr() / 6
    problem = client.problem(S, M, name="an interval")
    assert problem == client.problem(S.tocoo(), M.tocsc()) and problem != client.problem(S)
    for arguments in [{"k": 5}, {"k": 4, "sigma": 0.3}, {"below": 0.01}, {"between": (0.01, 0.02), "fixed": [0, 150]}]:
        here, there = chladni.eigsh(S, M=M, **arguments), client.eigsh(problem, **arguments)
        assert np.allclose(there.values, here.values, rtol=1e-12) and there.complete
        assert np.allclose(abs(there.vectors), abs(here.vectors), atol=1e-6) and there.moved == here.moved
        assert there.certificate.first == here.certificate.first
    assert np.allclose(client.eigsh(S, 3, np.full(n, 2.0), return_eigenvectors=False), chladni.eigsh(S, 3).values / 2)
    none = client.eigsh(problem, below=-1.0)
    assert none.values.shape == (0,) and none.vectors.shape == (n, 0)
    with pytest.raises(chladni.ClientError, match="at_most"):
        client.eigsh(problem, k=4, sigma=0.3, at_most=3)
    with pytest.raises(chladni.ClientError, match="not symmetric: S\\[0, 1\\]") as refused:
        client.eigsh(S + scipy.sparse.eye(n, k=1), 3)
    assert refused.value.status == 422 and refused.value.problem["row"] == 0
    with pytest.raises(chladni.ParameterError):
        client.eigsh(problem, 3, M)


def test_refusals_are_the_servers_sentences(client, knot):
    with pytest.raises(chladni.ClientError, match="tolerance") as caught:
        client.eigs(knot, k=5, method="hsim", tol=0.9)
    assert caught.value.status == 422 and caught.value.code == "invalid-parameter"
    with pytest.raises(chladni.ClientError) as caught:
        client.basis("nothing").values
    assert caught.value.status in (400, 404) and caught.value.problem["status"] == caught.value.status


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_an_interrupt_cancels_the_job(client, tmp_path):
    script = f"""
        import chladni, os, signal
        signal.signal(signal.SIGINT, signal.default_int_handler)
        client = chladni.Client({client.url!r})
        def watch(stage, fraction):
            if stage not in ("enqueued", "processing"):
                os.kill(os.getpid(), signal.SIGINT)
        try:
            client.eigs(chladni.Mesh.sample("knot", 100_000), k=1500, method="hsim", progress=watch)
        except KeyboardInterrupt:
            print("interrupted")
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert done.stdout.strip() == "interrupted", done.stderr
    jobs = client._json("GET", "/v1/jobs", query={"limit": 1})
    job = next(iter(jobs.get("items") or jobs.get("jobs") or jobs.get("data")))
    while job["status"] == "processing":
        job = client._json("GET", f"/v1/jobs/{job['id']}", query={"wait": "2s"})
    assert job["status"] == "canceled"


def test_a_server_that_is_not_there_is_named():
    with pytest.raises(chladni.ClientError, match="127.0.0.1:9 does not answer") as caught:
        chladni.Client("http://127.0.0.1:9").eigs(chladni.Mesh.sample("sphere", 162), k=3)
    assert caught.value.status == 0
    with pytest.raises(chladni.ParameterError, match="ftp"):
        chladni.Client("ftp://127.0.0.1")
    with pytest.raises(chladni.ParameterError, match="key must have only ASCII"):
        chladni.Client("http://127.0.0.1:9", "schlüssel")
