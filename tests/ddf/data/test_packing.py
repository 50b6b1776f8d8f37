"""Stored samples: rounding within half a step, exact codes of special values, both widths."""

import numpy as np
import pytest
import torch
from _shapes import random_rays
from _support import assert_close

from ddf.core import checks
from ddf.data import packing


@pytest.mark.parametrize(("dtype", "worst_deg"), [(np.int8, 0.95), (np.int16, 0.0037)])
def test_unit_vectors_survive_within_the_step(dtype, worst_deg):
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    vectors = np.concatenate([random_rays(20_000, seed=1).directions.numpy(), axes])
    decoded = packing.decode_unit(torch.from_numpy(packing.encode_unit(vectors, dtype))).double().numpy()
    sine, cosine = np.linalg.norm(np.cross(decoded, vectors), axis=1), (decoded * vectors).sum(axis=1)
    angles = np.degrees(np.arctan2(sine, cosine))
    assert worst_deg / 4 < angles.max() < worst_deg
    assert_close(decoded[-6:], axes, atol=1e-7)
    assert_close(np.linalg.norm(decoded, axis=1), np.ones(len(decoded)), atol=1e-6)


def test_positions_round_to_half_a_step_and_keep_the_walls():
    positions = np.concatenate([random_rays(5000, seed=3).positions.numpy(), [[1.0, -1.0, 0.0], [1.2, -3.0, 0.5]]])
    decoded = packing.decode_positions(torch.from_numpy(packing.encode_positions(positions))).double().numpy()
    assert np.abs(decoded[:-1] - positions[:-1]).max() <= 0.502 / packing.POSITION_STEPS
    assert (decoded[-2] == [1, -1, 0]).all() and (decoded[-1, :2] == [1, -1]).all()


def test_depth_rounds_to_half_a_step_and_keeps_misses():
    depth = np.concatenate([np.linspace(0, 2 * np.sqrt(3), 4001), [np.inf]])
    codes = packing.encode_depth(depth)
    decoded = packing.decode_depth(torch.from_numpy(codes)).double().numpy()
    assert np.abs(decoded[:-1] - depth[:-1]).max() <= 0.51 * packing.DEPTH_STEP
    assert codes[-1] == packing.MISS and np.isinf(decoded[-1]) and decoded[0] == 0


@pytest.mark.parametrize("bad", [-0.1, 3.6])
def test_depth_outside_the_box_is_refused(bad):
    with pytest.raises(checks.InputError, match="depth must be in"):
        packing.encode_depth(np.array([1.0, bad]))
