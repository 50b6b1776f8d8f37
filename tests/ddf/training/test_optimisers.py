import pytest
import torch

from ddf.fields import siren
from ddf.models import loop_config
from ddf.training import optimisers


class WithEncoder(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.network = siren.SineNetwork(3, siren.SineLayout((6, 5, 4)), 2)
        self.modulator = siren.Modulator(4, (6, 5, 4))
        self.encoder = torch.nn.Conv2d(3, 4, kernel_size=2)

    def latent(self, generator):
        images = torch.rand((2, 3, 4, 4), generator=generator)
        return self.encoder(images).sin().mean(dim=(-2, -1))  # a gradient of full rank, though of two images


def _model():
    torch.manual_seed(0)
    return WithEncoder()


def _loss(model, step=0):
    generator = torch.Generator().manual_seed(step)
    points = torch.rand((2, 7, 3), generator=generator)
    return model.network(points, model.modulator(model.latent(generator))).square().mean()


def _optimiser(model, muon, muon_kernels=None, weight_decay=0.0, share=1.0):
    groups = [{"params": list(model.parameters()), "weight_decay": weight_decay, "share": share}]
    config = loop_config.LoopConfig(1e-2, muon=muon, muon_kernels=muon_kernels)
    return optimisers.Optimiser(model, groups, config)


def _steps(model, optimiser, steps):
    for step in steps:
        optimiser.zero_grad()
        _loss(model, step).backward()
        optimiser.step()


def test_hidden_matrices_are_all_but_first_layers_heads_and_biases():
    model = _model()
    chosen = {id(weight) for weight in siren.hidden_matrices(model)}
    names = {name for name, parameter in model.named_parameters() if id(parameter) in chosen}
    of_network = {f"network.layers.{layer}.weight" for layer in (1, 2)}
    assert names == of_network | {f"modulator.layers.{layer}.weight" for layer in (0, 1, 2)}


def test_muon_is_that_of_torch_without_its_rounding_to_bfloat16(monkeypatch):
    monkeypatch.setattr(torch, "bfloat16", torch.float32)
    model, other = _model(), _model()
    ours, theirs = siren.hidden_matrices(model), siren.hidden_matrices(other)
    one = optimisers.Muon([{"params": ours, "weight_decay": 0.1}], 0.02)
    two = torch.optim.Muon(theirs, lr=0.02, weight_decay=0.1)
    _steps(model, one, range(5))
    _steps(other, two, range(5))
    for left, right in zip(ours, theirs, strict=True):
        torch.testing.assert_close(left, right, rtol=0, atol=1e-4)


@pytest.mark.parametrize("shape", [(7, 7), (7, 4), (4, 7), (9, 4), (4, 9)])
def test_nearest_orthogonal(shape):
    """Singular vectors stay, singular values come near 1; with the coefficients that converge they become 1."""
    matrix = torch.randn(shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    left, _, right = torch.linalg.svd(matrix, full_matrices=False)
    exact = left @ right
    converged = optimisers.nearest_orthogonal(matrix, (15 / 8, -10 / 8, 3 / 8), 40, 1e-7)
    torch.testing.assert_close(converged, exact)
    quick = torch.linalg.svdvals(optimisers.nearest_orthogonal(matrix, (3.4445, -4.775, 2.0315), 5, 1e-7))
    assert 0.5 < float(quick.min()) <= float(quick.max()) < 1.3
    assert torch.equal(optimisers.nearest_orthogonal(0 * matrix, (15 / 8, -10 / 8, 3 / 8), 5, 1e-7), 0 * matrix)


def test_weights_move_together_as_one_by_one(monkeypatch):
    sizes, moved = ((6, 6), (6, 6), (4, 2, 3), (6, 6), (3, 9), (3, 2, 4), (8, 3), (8, 3)), []  # the last four are long
    for together in (id, lambda weight: weight.shape):  # those of a CPU and of a GPU
        monkeypatch.setattr(optimisers.Muon, "_together", staticmethod(together))
        torch.manual_seed(0)
        weights = [torch.nn.Parameter(torch.randn(size).double()) for size in sizes]
        groups = [{"params": weights[:3], "weight_decay": 0.1}, {"params": weights[3:]}]
        muon = optimisers.Muon(groups, 0.02)
        for step in range(3):
            for weight in weights:
                weight.grad = torch.cos(weight.detach() * (step + 1))
            muon.step()
        moved.append([weight.detach() for weight in weights])
    for one, other in zip(*moved, strict=True):
        torch.testing.assert_close(one, other, atol=1e-12, rtol=1e-10)


def test_without_muon_it_is_adamw():
    model, other = _model(), _model()
    _steps(model, _optimiser(model, None, weight_decay=0.1), range(5))
    adamw = torch.optim.AdamW(other.parameters(), lr=1e-2, weight_decay=0.1, fused=True)
    _steps(other, adamw, range(5))
    for one, two in zip(model.parameters(), other.parameters(), strict=True):
        assert torch.equal(one, two)


def test_model_without_hidden_matrices_has_no_muon():
    model = torch.nn.Linear(3, 2)
    optimiser = _optimiser(model, 0.02, 0.02)
    model(torch.ones(1, 3)).sum().backward()
    optimiser.step()
    assert {name.partition(".")[0] for name, _ in optimiser.tensors()} == {"optimiser"}


@pytest.mark.parametrize(("muon", "kernels"), [(None, None), (0.02, None), (None, 0.02), (0.02, 0.01)])
def test_state_goes_on_where_it_was(muon, kernels):
    model, other = _model(), _model()
    optimiser = _optimiser(model, muon, kernels)
    _steps(model, optimiser, range(6))
    first = _optimiser(other, muon, kernels)
    _steps(other, first, range(3))
    second = _optimiser(other, muon, kernels)
    second.load({name: value.clone() for name, value in first.tensors()} | {"model.weight": torch.ones(1)})
    _steps(other, second, range(3, 6))
    for one, two in zip(model.parameters(), other.parameters(), strict=True):
        assert torch.equal(one, two)


@pytest.mark.parametrize(("muon", "kernels"), [(None, 0.02), (0.02, None), (0.02, 0.01)])
@pytest.mark.parametrize(("share", "rate"), [(1, 1e-2), (1, 1e-3), (0.1, 1e-2)])
def test_matrices_kernels_and_the_rest_have_rates_of_their_own(muon, kernels, share, rate):
    """AdamW's first step is its rate in every entry, and of a group's share; Muon's keep their ratio to the rate."""
    model = _model()
    before = {name: value.detach().clone() for name, value in model.named_parameters()}
    optimiser = _optimiser(model, muon, kernels, share=share)
    optimiser.set_rate(rate)
    _steps(model, optimiser, [0])
    for name, own in (("network.layers.1.weight", muon), ("encoder.weight", kernels), ("network.head.weight", None)):
        moved = (model.get_parameter(name).detach() - before[name]).flatten(1)
        if own is None:
            torch.testing.assert_close(moved.abs(), torch.full_like(moved, share * rate), rtol=1e-3, atol=0)
        else:
            assert 0.6 < float(torch.linalg.svdvals(moved.double()).max()) / (own * rate / 1e-2) < 1.3


def test_weight_decay_of_a_group_goes_with_its_matrices():
    model = _model()
    optimiser = _optimiser(model, 0.02, weight_decay=0.5)
    before = model.modulator.layers[1].weight.detach().clone()
    optimiser.zero_grad()
    (0.0 * _loss(model)).backward()
    optimiser.step()
    torch.testing.assert_close(model.modulator.layers[1].weight.detach(), before * (1 - 0.02 * 0.5))
