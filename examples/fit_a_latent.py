"""The shape of a chair from two depth views: its latent, found by a loss of one's own.

python examples/fit_a_latent.py
"""

import torch

import ddf

if __name__ == "__main__":
    torch.manual_seed(0)
    chairs = ddf.torch.Field.of_model("chair").requires_grad_(False)
    x, y = torch.meshgrid(*2 * [torch.linspace(-0.95, 0.95, 24)], indexing="ij")
    turns = torch.tensor([0.5, 2.2, 3.7])[:, None, None]  # two views that are seen, and one to judge by
    across, back = (torch.stack([t.cos(), 0 * t, t.sin()], -1) for t in (turns, turns + torch.pi / 2))
    positions = x[..., None] * across + y[..., None] * torch.tensor([0.0, 1, 0]) + 3 * back
    directions = (-back).expand_as(positions)
    truth = chairs(positions, directions, latent=torch.randn(16))  # in its place may stand what cameras saw
    latent = torch.zeros(16, requires_grad=True)
    optimiser = torch.optim.Adam([latent], lr=0.1)
    for step in range(60 + 1):
        off = (chairs(positions, directions, latent=latent).depth - truth.depth).abs()
        error = torch.where(truth.visibility > 0.5, off, 0.0).sum((1, 2)) / (truth.visibility > 0.5).sum((1, 2))
        if step in (0, 60):
            print(f"step {step}: depth is off by {error[:2].mean():.4f}, by {error[2]:.4f} in a view never seen")
        optimiser.zero_grad()
        (error[:2].mean() + 1e-3 * latent.square().mean()).backward()
        optimiser.step()
