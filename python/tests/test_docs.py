"""What the documentation shows works as pasted."""

import os
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"


@pytest.mark.skipif(not PAGE.exists(), reason="the page is not beside the package")
def test_the_tutorial_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    local = [block for block in blocks if "chladni.Client(" not in block]
    assert len(local) >= 3 and len(blocks) == len(local) + 1
    for block in local:
        exec(compile(block, str(PAGE), "exec"), names)  # noqa: S102
    assert names["hks"].shape == (len(names["mesh"].vertices), 16) and names["basis"].complete
    assert os.listdir("op_cache") and os.path.exists("knot.npz")


@pytest.mark.skipif(not PAGE.exists(), reason="the page is not beside the package")
@pytest.mark.parametrize("name", ["coming-from.md", "tutorial.md"])
def test_blocks_that_begin_with_the_package_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (PAGE.parent / name).read_text()
    blocks = [block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if block.startswith("import chladni")]
    assert blocks
    for block in blocks:
        exec(compile(block, name, "exec"), {})  # noqa: S102
