"""What the documentation shows works as pasted."""

import doctest
import inspect
import os
import re
from pathlib import Path

import numpy
import pytest

import chladni

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"

pytestmark = pytest.mark.skipif(not PAGE.exists(), reason="the pages are not beside the package")


def blocks_of(name):
    return re.findall(r"```python\n(.*?)```", (PAGE.parent / name).read_text(encoding="utf-8"), re.DOTALL)


def run(block, name, names):
    exec(compile(block, name, "exec"), names)  # noqa: S102
    return names


def test_the_tutorial_runs(tmp_path, monkeypatch, server):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    blocks = blocks_of("python.md")
    local = [block for block in blocks if "chladni.Client(" not in block]
    assert len(local) >= 3 and len(blocks) == len(local) + 1
    for block in local:
        run(block, "python.md", names)
    assert names["hks"].shape == (len(names["mesh"].vertices), 16) and names["basis"].complete
    assert os.listdir("op_cache") and os.path.exists("knot.npz")
    (remote,) = (block for block in blocks if "chladni.Client(" in block)
    assert "http://127.0.0.1:8080" in remote
    run(remote.replace("http://127.0.0.1:8080", server), "python.md", names)
    assert numpy.allclose(names["here"].values, names["there"].values)


@pytest.mark.parametrize("name", ["coming-from.md", "tutorial.md"])
def test_blocks_that_begin_with_the_package_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = [block for block in blocks_of(name) if block.startswith("import chladni")]
    assert blocks
    for block in blocks:
        run(block, name, {})


def test_the_lines_of_the_readme_and_of_other_pages_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = chladni.Mesh.sample("torus", 900)
    (five,) = blocks_of("../README.md")
    basis = run(five, "README.md", {"vertices": mesh.vertices, "faces": mesh.faces})["basis"]
    assert basis.complete
    (gradients,) = blocks_of("gradients.md")
    assert run(gradients, "gradients.md", {"basis": basis})["gradient"].shape == mesh.vertices.shape
    # A vertex that no face uses is in the file alone.
    basis = chladni.eigs(numpy.vstack([mesh.vertices, [[9.0, 9.0, 9.0]]]), mesh.faces, k=6, method="hsim")
    basis.save("bunny.npz")
    (numbering,) = blocks_of("numbering.md")
    on_file = run(numbering, "numbering.md", {"numpy": numpy})["on_file"]
    assert numpy.allclose(on_file, basis.vectors, equal_nan=True, atol=1e-6) and numpy.isnan(on_file[-1]).all()


def test_examples_of_methods_run(tmp_path, monkeypatch):
    """``--doctest-modules`` looks at functions and classes alone: methods of classes that say they come from ``chladni`` are none of its own."""
    monkeypatch.chdir(tmp_path)
    finder, runner, met = doctest.DocTestFinder(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS), 0
    for name in chladni.__all__:
        if not inspect.isclass(kind := getattr(chladni, name)):
            continue
        for member, thing in vars(kind).items():
            function = getattr(thing, "__func__", thing)
            if not inspect.isfunction(function):
                continue
            for example in finder.find(function, f"{name}.{member}", module=False, globs={}):
                met += bool(example.examples)
                runner.run(example)
    assert met >= 9 and runner.failures == 0
