"""Rows of the bench of generated shapes, on ellipsoids whose axes are their latents."""

from types import SimpleNamespace

import numpy as np
import pytest

from bench.reconstruction import generate


def _clouds(latents, noise=0.0):
    found = []
    for index, latent in enumerate(np.asarray(latents)):
        points = np.random.default_rng(index).normal(size=(200, 3))
        ball = points / np.linalg.norm(points, axis=1, keepdims=True)
        found.append(generate.framed(ball * np.exp(0.8 * np.array([0.0, *latent])), noise))
    return found


def test_fakes_are_ranked_behind_shapes_of_the_same_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    prior = SimpleNamespace(basis=np.zeros((5, 2)), latents=lambda latents: latents)
    monkeypatch.setattr(generate, "COUNT", 40)
    monkeypatch.setattr(generate.latent_prior, "load", lambda _: (None, prior, None))
    monkeypatch.setattr(generate, "decoded", lambda _, latents, noise=0.0: _clouds(latents, noise))
    monkeypatch.setattr(generate, "truth", lambda _, seed: _clouds(np.random.default_rng(seed).normal(size=(40, 2))))
    found = {row["what"].partition(": ")[2]: row["error"] for row in generate.rows("chair", 0, 1.0)}
    for name in ("other true shapes", "samples"):
        assert 25 < found[name]["one_nna_percent"] < 70
        assert found[name]["mmd_x1000"] > 0.05  # of other shapes, not of themselves
        for fake in ("mean shape", "blurred samples", "noisy samples"):
            assert found[fake]["mmd_x1000"] > 1.2 * found[name]["mmd_x1000"]
            assert found[fake]["one_nna_percent"] > found[name]["one_nna_percent"] + 5
        for fake in ("mean shape", "blurred samples"):
            assert found[fake]["energy_x1000"] > 2 * found[name]["energy_x1000"]
