"""A folder of meshes as a data set of PyTorch: positions, labels if there are any, and the operators of each surface, computed once.

    python dataset.py FOLDER CACHE        computes what is missing, with a bar; go on where it stopped by starting it again
"""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

import chladni

try:
    from torch.utils.data import Dataset
except ImportError:  # what is computed needs no torch
    Dataset = object

ENDINGS = {".obj", ".off", ".ply", ".stl"}


class Surfaces(Dataset):
    """The meshes of a folder, each with its operators (`chladni.Operators`) from a folder of files that are made as they are needed."""

    def __init__(self, folder: str, cache: str, k: int = 128) -> None:
        self.paths = sorted(path for path in Path(folder).iterdir() if path.suffix.lower() in ENDINGS)
        self.cache, self.k = Path(cache), k
        self.cache.mkdir(parents=True, exist_ok=True)

    def __len__(self) -> int:
        return len(self.paths)

    def file_of(self, index: int) -> Path:
        return self.cache / f"{self.paths[index].name}.k{self.k}.npz"

    def operators(self, index: int) -> chladni.Operators:
        """From the file, or computed and written: a file appears when it is whole, so that an interrupted run leaves none behind that is half."""
        file = self.file_of(index)
        if not file.exists():
            mesh = chladni.Mesh.read(self.paths[index])
            if len(mesh.kept_vertices) != len(mesh.vertices):
                mesh = chladni.Mesh(mesh.kept_vertices, mesh.kept_faces)
            chladni.operators(mesh, k=self.k).save(file)
        return chladni.Operators.load(file)

    def __getitem__(self, index: int) -> dict[str, np.ndarray]:
        found = self.operators(index)
        return {"name": self.paths[index].stem, "verts": found.vertices.astype(np.float32), "faces": found.faces, **found.arrays()}

    def prepare(self, at_once: int = 2) -> list[str]:
        """Computes what is missing, several at once; gives what could not be computed, and why."""

        def one(index: int) -> str | None:
            try:
                self.operators(index)
            except chladni.Error as error:
                return f"{self.paths[index].name}: {error}"
            return None

        with ThreadPoolExecutor(at_once) as pool:
            results = pool.map(one, range(len(self)))
            try:
                from tqdm import tqdm

                results = tqdm(results, total=len(self), unit="mesh")
            except ImportError:
                pass
            return [refusal for refusal in results if refusal]


if __name__ == "__main__":
    for refusal in Surfaces(*sys.argv[1:3]).prepare():
        print(refusal, file=sys.stderr)
