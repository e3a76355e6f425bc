"""A data set of PyTorch over what ``chladni batch FOLDER --kind operators -o CACHE`` made: needs neither the meshes nor chladni.

    chladni batch shapes --kind operators -n 128 -o op_cache
    python cached.py op_cache
"""

import sys
from pathlib import Path

import numpy as np

try:
    from torch.utils.data import Dataset
except ImportError:  # what is read needs no torch
    Dataset = object


class Cached(Dataset):
    """One surface for each file: positions, faces, frames, mass, eigenpairs, and the parts of the sparse matrices L, gradX and gradY (CSC)."""

    def __init__(self, cache: str) -> None:
        self.paths = sorted(Path(cache).glob("*_0.npz"))

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: int) -> dict[str, np.ndarray]:
        with np.load(self.paths[index]) as members:
            return {name: members[name] for name in members.files}


if __name__ == "__main__":
    surfaces = Cached(sys.argv[1])
    for index in range(len(surfaces)):
        surface = surfaces[index]
        print(len(surface["verts"]), "vertices,", surface["k_eig"].item(), "eigenpairs")
