"""The notebooks and the data set of ``examples/`` do what they say."""

import importlib.util
import json
import os
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

import chladni

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
NOTEBOOKS = sorted((EXAMPLES / "notebooks").glob("*.ipynb")) if EXAMPLES.exists() else []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_above(path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    names: dict[str, object] = {}
    cells = json.loads(path.read_text())["cells"]
    assert all(not cell.get("outputs") for cell in cells), "notebooks are kept without their outputs"
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), str(path), "exec"), names)  # noqa: S102
    import matplotlib.pyplot as plt

    assert plt.get_fignums()
    plt.close("all")


def write_off(path, mesh):
    vertices = "\n".join(f"{x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist())
    faces = "\n".join(f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist())
    path.write_text(f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n{vertices}\n{faces}\n")


@pytest.mark.skipif(not EXAMPLES.exists(), reason="the examples are not beside the package")
def test_a_folder_becomes_a_data_set(tmp_path):
    path = EXAMPLES / "learning" / "dataset.py"
    spec = importlib.util.spec_from_file_location("dataset", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder, cache = tmp_path / "meshes", tmp_path / "cache"
    folder.mkdir()
    for shape in ("sphere", "torus"):
        write_off(folder / f"{shape}.off", chladni.Mesh.sample(shape, 800))
    (folder / "broken.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n")
    (folder / "notes.txt").write_text("no mesh")
    surfaces = module.Surfaces(folder, cache, k=16)
    assert len(surfaces) == 3
    refused = surfaces.prepare()
    assert len(refused) == 1 and refused[0].startswith("broken.off:") and "9" in refused[0]
    made = {file.name: file.stat().st_mtime_ns for file in cache.iterdir()}
    assert set(made) == {"sphere.off.k16.npz", "torus.off.k16.npz"}
    time.sleep(0.01)
    item = surfaces[1]
    assert item["name"] == "sphere" and item["evecs"].shape == (len(item["verts"]), 16) and item["evecs"].dtype == np.float32
    assert {file.name: file.stat().st_mtime_ns for file in cache.iterdir()} == made, "what is there is not computed again"


@pytest.mark.skipif(not EXAMPLES.exists(), reason="the examples are not beside the package")
def test_a_folder_of_the_command_line_is_a_data_set(tmp_path):
    binary = os.environ.get("CHLADNI_BINARY")
    if not binary or not Path(binary).exists():
        pytest.skip("no binary: CHLADNI_BINARY names one")
    spec = importlib.util.spec_from_file_location("cached", EXAMPLES / "learning" / "cached.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    meshes, cache = tmp_path / "meshes", tmp_path / "cache"
    meshes.mkdir()
    write_off(meshes / "torus.off", chladni.Mesh.sample("torus", 800))
    subprocess.run([binary, "batch", meshes, "--kind", "operators", "-n", "24", "-q", "-o", cache], check=True, capture_output=True)
    surfaces = module.Cached(cache)
    assert len(surfaces) == 1
    found = surfaces[0]
    # The same as the package computes and writes, of arrays as a network is given them: byte for byte where no rounding is in between.
    own = chladni.operators(found["verts"], found["faces"], k=24)
    assert Path(own.save_cache(tmp_path / "own")).name == surfaces.paths[0].name
    for name, array in own.arrays().items():
        assert found[name].dtype == array.dtype and found[name].shape == array.shape, name
        if name not in ("evals", "evecs"):
            assert (found[name] == array).all(), name
    assert np.allclose(found["evals"], own.arrays()["evals"], atol=1e-4)
