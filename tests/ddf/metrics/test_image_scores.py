"""KID against its definition, what it ranks last, and the order of spoiled images."""

import pytest
import torch
from _support import assert_close
from torch.nn import functional

from ddf.metrics import image_scores


def test_kid_is_the_unbiased_mmd_of_the_cubic_kernel():
    generator = torch.Generator().manual_seed(0)
    first, second = (torch.randn((6, 3), generator=generator).double() for _ in "ab")
    within = sum(
        float((x[i] @ x[j] / 3 + 1) ** 3) / 30 for x in (first, second) for i in range(6) for j in range(6) if i != j
    )
    across = sum(float((a @ b / 3 + 1) ** 3) / 36 for a in first for b in second)
    found = image_scores.score(first, second, image_scores.Subsets(2, 6))
    assert found["kid"] == pytest.approx(within - 2 * across)
    assert found["kid_spread"] == pytest.approx(0, abs=1e-12)  # every subset is all of them


def test_the_mean_image_blur_and_noise_are_behind_other_images():
    def discs(seed):
        centres = torch.rand((60, 2, 1, 1), generator=torch.Generator().manual_seed(seed)) * 8 + 4
        places = torch.stack(torch.meshgrid(torch.arange(16.0), torch.arange(16.0), indexing="ij"))
        return 2 * ((places - centres).square().sum(1) < 9).float()[:, None].expand(-1, 3, -1, -1) - 1

    real, others = discs(0), discs(1)
    noise = torch.rand(real.shape, generator=torch.Generator().manual_seed(2)) * 2 - 1
    fakes = {"mean": real.mean(0).expand_as(real), "blur": image_scores.blurred(others, 2.0), "noise": noise}
    pooled = {  # of raw pixels, which hardly vary together, the mean image is the nearest
        name: functional.avg_pool2d(8 * (each + 1), 4).mean(1).flatten(1)
        for name, each in {"real": real, "others": others, **fakes}.items()
    }
    whole = image_scores.Subsets(2, 60)
    rows = {name: image_scores.score(pooled[name], pooled["real"], whole)["kid"] for name in ("others", *fakes)}
    assert min(rows, key=lambda name: rows[name]) == "others"
    assert min(rows[name] for name in fakes) > 3 * abs(rows["others"])


@pytest.mark.parametrize(
    ("changed", "holds"),
    [({}, True), ({"blur 4": 1.5}, False), ({"noise 0.05": -1.0}, False), ({"ceiling": 9.0}, False)],
)
def test_the_order_that_a_score_must_have(changed, holds):
    kids = {"ceiling": 0.0, "blur 2": 2.0, "blur 4": 3.0, "noise 0.05": 1.0, "noise 0.15": 2.0}
    assert image_scores.in_order({**kids, **changed}) == holds


def test_blur_keeps_even_images_and_noise_has_its_spread():
    even = torch.full((2, 3, 64, 64), 0.25)
    assert_close(image_scores.blurred(even, 4.0), even)
    step = torch.cat((even[..., :32] * 0, even[..., 32:]), dim=-1)
    weights = torch.exp(-0.5 * (torch.arange(-8, 9) / 4.0) ** 2)
    beside = 0.25 * float(weights[:8].sum() / weights.sum())
    assert float(image_scores.blurred(step, 4.0)[0, 0, 32, 31]) == pytest.approx(beside, rel=0.02)
    found = image_scores.noisy(torch.zeros(1, 3, 64, 64), 0.05, 0)
    assert float(found.std()) == pytest.approx(0.1, rel=0.05)


def test_a_set_that_is_too_small_is_told():
    features = torch.zeros(5, 2)
    with pytest.raises(ValueError, match="must be at most the 5 images of 'ours'; got 6"):
        image_scores.table({"ours": features}, torch.zeros(6, 2), image_scores.Subsets(2, 6))
