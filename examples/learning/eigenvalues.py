"""Eigenvalues as a layer: positions in, the lowest eigenvalues out, with gradients, for PyTorch.

    python3 examples/learning/eigenvalues.py bunny.obj

bends a surface, at first by random numbers, until its spectrum is that of the file again. Needs torch. The connectivity stays as it is, so that steps are to be small against the triangles.
"""

import sys

import chladni
import torch


class Eigenvalues(torch.autograd.Function):
    """The lowest `count` eigenvalues of the cotangent Laplacian as a function of vertex positions, (n, 3) to (count,)."""

    @staticmethod
    def forward(context, positions, faces, count):
        mesh = chladni.Mesh(positions.detach().cpu().double().numpy(), faces)
        context.basis = chladni.eigs(mesh, k=count, operator="laplace", method="hsim", tol=1e-6)
        return torch.as_tensor(context.basis.values, dtype=positions.dtype, device=positions.device)

    @staticmethod
    def backward(context, weights):
        gradient = context.basis.value_gradient(weights.detach().cpu().double().numpy())
        return torch.as_tensor(gradient, dtype=weights.dtype, device=weights.device), None, None


if __name__ == "__main__":
    wanted = chladni.Mesh.read(sys.argv[1])
    faces = wanted.kept_faces
    target = torch.as_tensor(wanted.kept_vertices)
    spectrum = Eigenvalues.apply(target, faces, 30)
    torch.manual_seed(1)
    size = wanted.area**0.5
    # A smooth bend: one random wave for each axis.
    waves = torch.randn(3, 3, dtype=torch.float64) * 6 / size
    positions = (target + 0.02 * size * torch.sin(target @ waves)).requires_grad_()
    optimiser = torch.optim.Adam([positions], lr=1e-4 * size)
    for step in range(60):
        optimiser.zero_grad()
        found = Eigenvalues.apply(positions, faces, 30)
        # Relative differences, the kernel apart.
        loss = (((found - spectrum)[1:] / spectrum[1:]) ** 2).mean()
        loss.backward()
        optimiser.step()
        if step % 10 == 0:
            print(f"step {step}: eigenvalues are {100 * loss.item() ** 0.5:.3f} % off")
    print(f"in the end: {100 * loss.item() ** 0.5:.3f} %")
