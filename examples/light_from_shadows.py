"""Where a lamp is, by the shadow of an object on its ground: rays from the ground to the lamp, and their gradients.

python examples/light_from_shadows.py
"""

import torch
from torch.nn import functional

import ddf

if __name__ == "__main__":
    field = ddf.torch.Field(ddf.load("rabbit")).requires_grad_(False)
    x, z = torch.meshgrid(*2 * [torch.linspace(-2.5, 2.5, 40)], indexing="ij")
    ground = torch.stack([x, torch.full_like(x, -0.54), z], -1)

    def shadow(lamp: torch.Tensor) -> torch.Tensor:
        """1 where the object stands before the lamp."""
        return field(ground, functional.normalize(lamp - ground, dim=-1)).visibility

    true = torch.tensor([1.4, 3.0, -0.8])
    picture = shadow(true)  # in its place may stand a photograph
    lamp = torch.tensor([-0.5, 4.0, 1.0], requires_grad=True)
    optimiser = torch.optim.Adam([lamp], lr=0.1)
    for step in range(120 + 1):
        loss = functional.mse_loss(shadow(lamp), picture)
        if step in (0, 120):
            print(f"step {step}: {(lamp - true).norm():.3f} from the lamp")
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
