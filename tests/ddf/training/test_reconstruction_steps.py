"""Steps of both reconstruction models: batches, totals by hand, and the Chamfer loss with its nearest points."""

import copy
import dataclasses
import functools

import _hand_made
import numpy as np
import pytest
import torch
from _hand_made import DDF, PCSIREN, TRAIN
from _plain_loss import plain_loss

from ddf.fields import losses, rendering
from ddf.geometry import transforms
from ddf.models import reconstruction_models
from ddf.training import reconstruction_steps


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("kind", ["ddf", "pcsiren"])
def test_steps_lower_the_loss_and_reach_every_parameter(kind, told):
    torch.manual_seed(0)
    train = dataclasses.replace(TRAIN, told=told)
    images, shapes, samples = _hand_made.images(), _hand_made.shapes(), _hand_made.samples()
    if kind == "ddf":
        model = reconstruction_models.DDFModel(train, DDF.field)
        step = functools.partial(reconstruction_steps.ddf_step, model, images, shapes, samples, train, DDF, 0)
    else:
        model = reconstruction_models.PCSirenModel(train)
        step = functools.partial(reconstruction_steps.pcsiren_step, model, images, shapes, train, PCSIREN, 0)
    model.fit_cameras(images)
    assert {"camera"} < set(step()[1])
    _hand_made.assert_learns(model, lambda: step()[0])


SEEDED = dataclasses.replace(TRAIN, loop=dataclasses.replace(TRAIN.loop, seed=5))
STEP = 2


def _by_hand(model, images):
    """A float64 copy of the model in training mode, and the images and cameras of the step, by its seed and number."""
    random = np.random.default_rng((SEEDED.loop.seed, STEP))
    rows = random.choice(len(images.shapes), SEEDED.batch_size, replace=False)
    shown = torch.stack([images.images[int(row)] for row in rows]).double() / 255
    return copy.deepcopy(model).double(), random, rows, shown, images.cameras[rows].double()


def _camera_loss(model, scores, truth, images):
    """‖Π_g - Π̂‖² of z-scores by the statistics of all training cameras, mean over images."""
    known = images.cameras.double()
    wanted = (truth - known.mean(dim=0)) / known.std(dim=0)
    return (scores - wanted).square().sum(dim=-1).mean()


@pytest.mark.parametrize("pixels", [None, 20])
def test_ddf_step_is_the_weighted_sum_of_its_parts(pixels):
    torch.manual_seed(0)
    images, shapes, samples = _hand_made.images(), _hand_made.shapes(), _hand_made.samples()
    frames = [transforms.Similarity(2.0 + i, translation=np.array([0.1 * i, 0.0, -0.05])) for i in range(3)]
    shapes = dataclasses.replace(shapes, similarities=frames)
    config = dataclasses.replace(DDF, mask_weight=4.0, mask_pixels=pixels)
    model = reconstruction_models.DDFModel(SEEDED, config.field)
    model.camera_head.fit(images.cameras)
    exact, random, rows, shown, truth = _by_hand(model, images)
    found, terms = reconstruction_steps.ddf_step(model, images, shapes, samples, SEEDED, config, STEP)

    drawn = images.shapes[rows]
    modulations = exact.decoder.modulator(exact.shape_encoder(shown))
    points = samples.draw(drawn, config.counts, random)
    points = dataclasses.replace(points, **{k: v.double() for k, v in vars(points).items() if k != "counts"})
    shape_loss = plain_loss(exact.field, points, modulations, config.weights)
    scores = exact.camera_encoder(shown)
    camera_loss = _camera_loss(exact, scores, truth, images)
    predicted = exact.camera_head(scores)
    masks = []
    for row, shape in enumerate(drawn):
        scale, shift = torch.tensor(frames[shape].scale), torch.tensor(frames[shape].translation)
        directions = torch.nn.functional.normalize(_pixels(config.mask_size), dim=-1)
        entry, world, _, meets = rendering.field_rays(predicted[row], scale, directions, shift)
        raw = exact.field(entry[None], world[None], [m[row : row + 1] for m in modulations])[0]
        visible = torch.where(meets, torch.sigmoid(raw[..., 3]), 0.0)
        masks.append((visible, images.alpha(rows[row : row + 1], config.mask_size)[0].double().flatten(), meets))
    of_each = [torch.nn.functional.binary_cross_entropy(visible, alpha) for visible, alpha, _ in masks]
    mask_loss = torch.stack(of_each if pixels is None else _of_some(masks, pixels, random)).mean()
    expected = shape_loss + 5.0 * camera_loss + 4.0 * mask_loss
    torch.testing.assert_close(found.double(), expected, rtol=2e-4, atol=0)
    torch.testing.assert_close(terms["camera"].double(), camera_loss, rtol=1e-4, atol=0)
    torch.testing.assert_close(terms["mask"].double(), mask_loss, rtol=1e-3, atol=0)
    assert min(float(each.detach().abs()) for each in (shape_loss, camera_loss, mask_loss)) > 0.1


def _pixels(size):
    """Camera-frame directions through pixel centres: f = 149.84375 and c = 68.5 at 137 pixels."""
    place = (torch.arange(size, dtype=torch.float64) + 0.5) * 137 / size
    v, u = torch.meshgrid(place, place, indexing="ij")
    return torch.stack(((u - 68.5) / 149.84375, (v - 68.5) / -149.84375, -torch.ones_like(u)), dim=-1).reshape(-1, 3)


def _of_some(masks, pixels, random):
    """The same of the pixels with the largest chances among those that meet the cube, for all of those."""
    generator = torch.Generator().manual_seed(int(random.integers(2**62)))
    chances = torch.rand((len(masks), len(masks[0][0])), generator=generator)
    losses = []
    for (visible, alpha, meets), chance in zip(masks, chances, strict=True):
        chosen = (chance * meets + meets).topk(pixels).indices
        seen = torch.nn.functional.binary_cross_entropy(visible[chosen], alpha[chosen])
        losses.append(seen * meets.double().mean() + 100 * (alpha * ~meets).mean())
    return losses


def test_pcsiren_step_is_the_weighted_sum_of_its_parts():
    torch.manual_seed(0)
    images, shapes = _hand_made.images(), _hand_made.shapes()
    model = reconstruction_models.PCSirenModel(SEEDED)
    model.camera_head.fit(images.cameras)
    exact, random, rows, shown, truth = _by_hand(model, images)
    found, terms = reconstruction_steps.pcsiren_step(model, images, shapes, SEEDED, PCSIREN, STEP)

    drawn = images.shapes[rows]
    clouds = []
    for shape in drawn:
        cloud = shapes.cloud(int(shape))
        chosen = random.choice(len(cloud), PCSIREN.truth_points, replace=False)
        assert len(set(chosen)) == PCSIREN.truth_points and chosen.max() >= PCSIREN.truth_points
        clouds.append(cloud[torch.from_numpy(chosen)].double())
    seeds = torch.from_numpy(random.uniform(-1, 1, (len(drawn), PCSIREN.points, 3)).astype(np.float32)).double()
    predicted = exact.decoder(seeds, exact.shape_encoder(shown))
    apart = torch.cdist(predicted, torch.stack(clouds)).square()
    chamfer = (apart.amin(dim=2).mean(dim=1) + apart.amin(dim=1).mean(dim=1)).mean()
    camera_loss = _camera_loss(exact, exact.camera_encoder(shown), truth, images)
    torch.testing.assert_close(found.double(), chamfer + 5.0 * camera_loss, rtol=1e-4, atol=0)
    torch.testing.assert_close(terms["chamfer"].double(), chamfer, rtol=1e-4, atol=0)


def test_mirrored_images_learn_the_mirrored_camera_and_predictions_are_mirrored_back():
    train = dataclasses.replace(TRAIN, told=True)
    batch = reconstruction_steps.Batch.draw(_hand_made.images(), train, 0)
    shown, wanted, answer = [], [], torch.tensor([[1.0, 0.3, 1.5]]).expand(len(batch.images), 3)

    class Encoder(torch.nn.Module):
        def forward(self, images):
            shown.append(images)
            return images

    class Head(torch.nn.Module):
        def forward(self, scores):
            return answer

        def loss(self, scores, cameras):
            wanted.append(cameras)
            return cameras.sum()

    model = reconstruction_models.DDFModel(train, DDF.field)
    for name, module in (("camera_encoder", Encoder()), ("camera_head", Head())):
        model.add_module(name, module)
    _, predicted = reconstruction_steps.camera_loss(model, batch, train)
    flipped = torch.tensor([not torch.equal(a, b) for a, b in zip(shown[0], batch.images, strict=True)])
    assert torch.equal(shown[0][flipped], batch.images[flipped].flip(-1)) and 0 < int(flipped.sum()) < len(flipped)
    turn = torch.where(flipped, -1.0, 1.0)
    torch.testing.assert_close(wanted[0][:, 0], turn * batch.cameras[:, 0] % (2 * np.pi))
    torch.testing.assert_close(predicted[:, 0], turn * answer[:, 0] % (2 * np.pi))
    torch.testing.assert_close(wanted[0][:, 1:], batch.cameras[:, 1:])


def test_chamfer_loss_equals_the_double_loop():
    generator = torch.Generator().manual_seed(0)
    a = torch.randn(2, 7, 3, generator=generator, dtype=torch.float64, requires_grad=True)
    b = torch.randn(2, 5, 3, generator=generator, dtype=torch.float64)
    distance = torch.cdist(a, b).square()
    expected = distance.amin(2).mean() + distance.amin(1).mean()
    torch.testing.assert_close(reconstruction_steps.chamfer_loss(a, b), expected)
    assert torch.autograd.gradcheck(lambda x: reconstruction_steps.chamfer_loss(x, b), (a,))


def test_chamfer_loss_is_the_same_in_blocks(monkeypatch):
    generator = torch.Generator().manual_seed(1)
    a, b = torch.randn(3, 40, 3, generator=generator), torch.randn(3, 90, 3, generator=generator)
    whole = reconstruction_steps.chamfer_loss(a, b)
    for block in (1, 40 * 7, 40 * 90, 2 * 40 * 90):  # a column, seven, a shape, two shapes at a time
        monkeypatch.setitem(losses.BLOCK_VALUES, "cpu", block)
        assert reconstruction_steps.chamfer_loss(a, b) == whole


@pytest.mark.parametrize(("count", "others"), [(7, 33), (40, 96), (1, 5), (64, 32)])
def test_nearest_points_are_those_of_all_distances(count, others):
    """Whole numbers as coordinates: many distances are equal, and of these the first one counts."""
    generator = torch.Generator().manual_seed(0)
    a, b = (torch.randint(-2, 3, (3, size, 3), generator=generator).float() for size in (count, others))
    dist_sq = (a[:, :, None] - b[:, None]).square().sum(-1)
    to_truth, to_predicted = reconstruction_steps._nearest(a, b)
    assert torch.equal(to_truth, dist_sq.argmin(2))
    assert torch.equal(to_predicted, dist_sq.argmin(1))
