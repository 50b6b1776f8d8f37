"""A depth renderer: a small convolutional network from a camera to a whole image is a DDF of its pixels.

[DDF22] app. `neurren`. It is trained on images of the shipped rabbit's field, plain or with the losses of a DDF on its
pixels: δ_p · v = -1 (Property I) and δ_ω = d (v × δ_p) (Property III), δ_p and δ_ω the derivatives in the camera's
position and turn. Prints the errors at cameras that it has not seen.
"""

import argparse
import functools

import torch
from torch import Tensor, nn

import ddf

SIZE, FOCAL, HELD_OUT = 32, 2.19, 32


def cameras(count: int, seed: int) -> tuple[Tensor, Tensor]:
    """Positions (n, 3), and axes (n, 3, 3) with rows right, up and backwards, looking at the origin."""
    random = torch.Generator().manual_seed(seed)
    azimuth, elevation, radius = (torch.rand(3, count, generator=random).T * torch.tensor([1.57, 0.78, 0.7])).T
    back = torch.stack((elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin()), -1)
    right = nn.functional.normalize(torch.linalg.cross(torch.tensor([0.0, 1, 0]).expand_as(back), back), dim=-1)
    return (2.5 + radius)[:, None] * back, torch.stack((right, torch.linalg.cross(back, right), back), 1)


def directions(axes: Tensor, size: int) -> Tensor:
    """Unit v of every pixel, (n, size, size, 3), rows from the top."""
    grid = (torch.arange(size) + 0.5) / size * 2 - 1
    x, y = torch.meshgrid(grid, -grid, indexing="xy")
    pixels = nn.functional.normalize(torch.stack((x, y, torch.full_like(x, -FOCAL)), -1), dim=-1)
    return torch.einsum("hwi,nij->nhwj", pixels, axes)


def truth(field: ddf.Field, positions: Tensor, axes: Tensor) -> tuple[Tensor, Tensor]:
    """Depth (0 where nothing is seen) and visibility, (n, size, size), of the field moved and scaled to length 2."""
    lower, upper = (torch.as_tensor(corner).float() for corner in field.box)
    scale, centre = float((upper - lower).max()) / 2, (lower + upper) / 2
    v = directions(axes, SIZE)
    p = positions[:, None, None].expand_as(v) * scale + centre
    found = field.query(p.reshape(-1, 3).numpy(), v.reshape(-1, 3).numpy(), outputs=("depth", "visibility"))
    depth, seen = (torch.from_numpy(found[name]).float().view(v.shape[:3]) for name in ("depth", "visibility"))
    return torch.where(seen >= 0.5, depth / scale, 0.0), seen >= 0.5


class DepthRenderer(nn.Module):
    """Rays (C_p, v) at a quarter, half and the full size go through sine convolutions, from the coarse to the fine."""

    def __init__(self) -> None:
        super().__init__()
        sizes = ((6, 64), (64, 64), (70, 32), (38, 24), (24, 24))
        convolutions = [nn.Conv2d(a, b, 3, padding=1) for a, b in sizes]
        self.layers, self.head = nn.ModuleList(convolutions), nn.Conv2d(24, 2, 1)
        for layer in (*convolutions, self.head):
            bound = (6 / layer.weight[0].numel()) ** 0.5
            nn.init.uniform_(layer.weight, -bound, bound)

    def forward(self, positions: Tensor, axes: Tensor) -> Tensor:
        """Depth and visibility logit, (n, 2, size, size): depth is counted from where a ray passes the origin."""
        hidden, size = None, 0
        for layer, share in zip(self.layers, (4, 4, 2, 1, 1), strict=True):
            if SIZE // share != size:
                size = SIZE // share
                v = directions(axes, size)
                rays = 2 * torch.cat((positions[:, None, None].expand_as(v), v), -1).movedim(-1, 1)
                finer = None if hidden is None else nn.functional.interpolate(hidden, scale_factor=2, mode="nearest")
                hidden = rays if finer is None else torch.cat((finer, rays), 1)
            hidden = layer(hidden).sin()
        raw, v = self.head(hidden), directions(axes, SIZE)
        middle = -(positions[:, None, None] * v).sum(-1)
        return raw + torch.stack((middle, torch.zeros_like(middle)), 1)


def residuals(renderer: DepthRenderer, positions: Tensor, axes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Depth, and the residuals of Properties I and III, (n, size, size[, 3]): six tangents of the camera."""

    def depth(moved: Tensor, turned: Tensor) -> Tensor:
        zero = torch.zeros(())
        x, y, z = turned
        skew = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).view(3, 3)
        return renderer(positions + moved, axes @ torch.linalg.matrix_exp(skew).T)[:, 0]

    d = renderer(positions, axes)[:, 0]
    found = torch.func.jacfwd(functools.partial(depth), argnums=(0, 1))(torch.zeros(3), torch.zeros(3))
    v = directions(axes, SIZE)
    along = (found[0] * v).sum(-1) + 1
    return d, along, found[1] - d[..., None] * torch.linalg.cross(v, found[0])


def main() -> None:
    """Train, and print the errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--images", type=int, default=256, help="that it is trained on")
    parser.add_argument("--ddf", type=float, default=0.5, help="weight of the losses of a DDF; 0: none")
    args = parser.parse_args()
    torch.manual_seed(0)
    field, renderer = ddf.load("rabbit"), DepthRenderer()
    given, asked = cameras(args.images, 0), cameras(HELD_OUT, 1)
    depth, visible = truth(field, *given)
    optimiser = torch.optim.Adam(renderer.parameters(), 3e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, args.steps)
    for _ in range(args.steps):
        rows = torch.randint(args.images, (8,))
        raw = renderer(given[0][rows], given[1][rows])
        off = nn.functional.huber_loss(raw[:, 0], depth[rows], reduction="none", delta=0.02) / 0.02
        loss = 5 * (visible[rows] * off).mean()
        loss = loss + nn.functional.binary_cross_entropy_with_logits(raw[:, 1], visible[rows].float())
        if args.ddf:
            d, along, across = residuals(renderer, given[0][rows[:2]], given[1][rows[:2]])
            seen, square = visible[rows[:2]], across.square().sum(-1) / d.detach().square()
            loss = loss + args.ddf * ((seen * along.square()).mean() + (seen * square).mean())
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    with torch.no_grad():
        d, along, _ = residuals(renderer, *asked)
        true, seen = truth(field, *asked)
        both = seen & (renderer(*asked)[:, 1] >= 0)
    print(f"depth {(d - true).abs()[both].median():.4f}, Property I off by {along.abs()[both].median():.3f}")


if __name__ == "__main__":
    main()
