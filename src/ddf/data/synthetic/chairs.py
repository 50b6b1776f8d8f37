"""Chairs: four-legged, sledge, pedestal, cantilever, shell and upholstered ones, facing +X, in metres."""

import numpy as np

from ddf.data.synthetic import chair_bases, chair_parts, palette, parts
from ddf.data.synthetic.chair_parts import Frame
from ddf.data.synthetic.parts import Part

BASES = ("legs", "crossed", "rocker", "sledge", "star", "disc", "cantilever", "block")
BASE_ODDS = (0.37, 0.05, 0.05, 0.09, 0.14, 0.08, 0.08, 0.14)
METAL_BASES = ("sledge", "star", "disc", "cantilever")
BUILDERS = {
    "legs": chair_bases.four_legs,
    "crossed": chair_bases.crossed,
    "rocker": chair_bases.rocker,
    "sledge": chair_bases.sledge,
    "star": chair_bases.star,
    "disc": chair_bases.disc,
    "cantilever": chair_bases.cantilever,
}


def build(rng: np.random.Generator) -> list[Part]:
    """One chair."""
    base = str(rng.choice(BASES, p=BASE_ODDS))
    wood, cloth = palette.chair(rng, is_metal=base in METAL_BASES)
    tall = base in ("legs", "disc", "star") and rng.random() < 0.08  # a bar stool
    frame = Frame(
        width=rng.uniform(0.38, 0.6),
        depth=rng.uniform(0.37, 0.54),
        seat=rng.uniform(0.62, 0.8) if tall else rng.uniform(0.36, 0.52),
        thickness=rng.uniform(0.02, 0.1),
        back=rng.uniform(0.16, 0.34) if tall else rng.uniform(0.28, 0.75),
        lean=rng.uniform(0.02, 0.32),
        wood=wood,
        cloth=cloth,
    )
    if base == "block":
        return _armchair(rng, frame)
    pieces = BUILDERS[base](rng, frame)
    if base in ("legs", "star", "disc", "sledge") and rng.random() < 0.2:
        return [*pieces, *chair_parts.shell(rng, frame)]
    pieces += chair_parts.seat(rng, frame)
    pieces += chair_parts.back(rng, frame)
    if rng.random() < 0.42:
        pieces += chair_parts.arms(rng, frame)
    return pieces


def _armchair(rng: np.random.Generator, f: Frame) -> list[Part]:
    """A club chair: upholstered blocks on short feet."""
    width, depth = f.width * rng.uniform(1.35, 1.75), f.depth * rng.uniform(1.4, 1.7)
    seat, arm = rng.uniform(0.34, 0.44), rng.uniform(0.09, 0.17)
    foot = rng.uniform(0.03, 0.14)
    back, arm_height = rng.uniform(0.32, 0.55), rng.uniform(0.12, 0.26)
    thick = rng.uniform(0.12, 0.2)
    lean = rng.uniform(0.0, 0.2)
    frame = Frame(width, depth, seat, seat - foot, back, lean, f.wood, f.cloth)
    pieces = [
        parts.box((0, (foot + seat - 0.1) / 2, 0), (depth, seat - 0.1 - foot, width), f.cloth, name="body"),
        chair_parts.cushion(frame, (0.02, seat, 0), (depth - thick * 0.6, 0.15, width - 2 * arm + 0.01), 7.0),
    ]
    rear = parts.box(
        (-depth / 2 + thick / 2, (foot + seat + back) / 2, 0), (thick, seat + back - foot, width), f.cloth, name="back"
    )
    pieces.append(rear.turned("z", lean, (-depth / 2, foot, 0)))
    if rng.random() < 0.6:
        roll = parts.lathe(parts.disc_profile(arm * 0.62, depth * 0.46, 0.02), f.cloth, sides=18, axis="x", name="roll")
        pieces += parts.both_sides([roll.moved(0.02, seat + arm_height - arm * 0.5, width / 2 - arm / 2)])
    side = parts.box(
        (0.0, (foot + seat + arm_height) / 2, width / 2 - arm / 2),
        (depth, seat + arm_height - foot, arm),
        f.cloth,
        name="arm",
    )
    pieces += parts.both_sides([side])
    if rng.random() < 0.25:
        wing = parts.box(
            (-depth / 2 + thick, seat + back * 0.62, width / 2 - arm * 0.4), (0.26, back * 0.72, arm * 0.7), f.cloth
        )
        pieces += parts.both_sides([wing.turned("z", lean, (-depth / 2, foot, 0))])
    if rng.random() < 0.7:
        pillow = chair_parts.cushion(frame, (0, 0, 0), (back * 0.95, thick * 0.7, width - 2 * arm), 6.0)
        pieces.append(
            pillow.turned("z", -np.pi / 2 + lean).moved(-depth / 2 + thick * 1.5 - lean * back / 2, seat + back / 2, 0)
        )
    leg = parts.tube([(0, foot + 0.01, 0), (0, 0, 0)], [0.03, 0.018], f.wood, sides=8, name="foot")
    x, z = depth / 2 - 0.06, width / 2 - 0.06
    return pieces + [leg.moved(i * x, 0, j * z) for i in (-1, 1) for j in (-1, 1)]
