"""Where an object stands: six numbers in an optimiser of one's own, by depth and silhouette of one view.

python examples/pose_in_a_loop.py
"""

import torch
from torch.nn import functional

import ddf

if __name__ == "__main__":
    field = ddf.torch.Field(ddf.load("rabbit")).requires_grad_(False)
    x, y = torch.meshgrid(torch.linspace(-0.8, 0.8, 32), torch.linspace(-0.8, 1.6, 32), indexing="ij")
    positions = torch.stack([x, y, torch.full_like(x, 3.0)], -1)
    directions = torch.tensor([0.0, 0.0, -1.0]).expand_as(positions)
    truth = field(positions, directions)  # the true pose is the unit matrix
    numbers = torch.tensor([0.15, -0.2, 0.1, 0.1, -0.08, 0.1], requires_grad=True)  # turn, and shift
    optimiser = torch.optim.Adam([numbers], lr=0.01)
    for step in range(80 + 1):
        skew = torch.linalg.cross(torch.eye(3), numbers[:3].expand(3, 3))
        pose = torch.linalg.matrix_exp(functional.pad(torch.cat([skew, numbers[3:, None]], 1), (0, 0, 0, 1)))
        if step in (0, 80):
            angle = torch.rad2deg(numbers[:3].norm()).item()
            print(f"step {step}: turned by {angle:.2f} degrees, moved by {pose[:3, 3].norm():.4f} from the true pose")
        seen = field(positions, directions, pose)
        both = (seen.visibility > 0.5) & (truth.visibility > 0.5)
        loss = functional.huber_loss(seen.depth[both], truth.depth[both], delta=0.05)
        optimiser.zero_grad()
        (loss + 0.1 * functional.mse_loss(seen.visibility, truth.visibility)).backward()
        optimiser.step()
