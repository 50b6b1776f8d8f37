"""The field with image features along the ray: closed forms, exact derivatives, what the image rules out."""

import copy

import _hand_made
import _models
import numpy as np
import pytest
import torch
from torch.nn import functional

from ddf.data.batches import category_data
from ddf.fields import framed_field
from ddf.geometry import cameras, rays, transforms
from ddf.models import line_field
from ddf.training import line_steps

CONFIG = line_field.LineFieldConfig(places=8, width=16, steps=3, rays=60)


def _rays(count, seed=1):
    positions, directions = (each.double() for each in _models.points(count, seed))
    return 0.8 * positions, functional.normalize(directions, dim=-1)


@pytest.fixture(scope="module")
def field():
    """Of one image, with logits large enough that some parts are hit."""
    model, images, first = _models.line_model().double(), _hand_made.images(), np.array([0])
    views = model.views(images.batch(first).double(), images.cameras_of(first).double())
    return line_field.ImageField.of(model.decoder, views)


def test_weights_are_the_chance_of_the_first_hit_ahead():
    logits = torch.tensor([[[0.3, -1.0, 2.0]]], dtype=torch.float64)
    hits = torch.tensor([[[-0.2, 0.1, 0.5]]], dtype=torch.float64)
    parts = line_field.Parts(hits, logits, torch.zeros(1, 1).double(), torch.ones(1, 1).double())
    weights, missed = parts.log_weights()
    _, a, b = logits[0, 0].sigmoid().tolist()
    assert weights[0, 0].exp()[1:].tolist() == pytest.approx([a, (1 - a) * b], rel=1e-3)  # the first lies behind p
    assert float(missed.exp()) == pytest.approx((1 - a) * (1 - b), rel=1e-3)
    assert float(weights.exp().sum() + missed.exp()) == pytest.approx(1, abs=1e-12)


def test_what_a_ray_does_not_reach_is_not_asked_and_changes_nothing(field, monkeypatch):
    """Weights up to a part, and the chance to meet nothing, with their gradients, are those of all parts."""
    positions, directions = _rays(300)
    decoder = copy.deepcopy(field.decoder).requires_grad_()
    entry, step, _ = decoder.span(positions, directions)
    far = torch.rand(300, generator=torch.Generator().manual_seed(4)).double()
    depth = torch.where(torch.arange(300) % 3 == 0, torch.inf, far)
    last = line_field.part_of(depth, entry, step).clamp(0, 7).long()
    rows, answers, found = [], line_field.LineDecoder.answers, []
    monkeypatch.setattr(
        line_field.LineDecoder,
        "answers",
        lambda self, views, row, *at: rows.append(len(row)) or answers(self, views, row, *at),
    )
    for until in (None, depth[None]):
        parts = decoder(field.views, positions[None], directions[None], until)
        weights, missed = parts.log_weights()
        loss = torch.where(depth.isfinite(), weights[0].gather(-1, last[:, None])[:, 0], missed[0])
        slopes = torch.autograd.grad(loss.sum(), [*decoder.parameters()])
        found.append(torch.cat([loss.detach(), *(slope.flatten() for slope in slopes)]))
    torch.testing.assert_close(found[0], found[1], rtol=1e-9, atol=1e-12)
    assert 0 < rows[1] < 0.6 * rows[0]


def test_distance_falls_by_what_p_moves_along_the_ray(field):
    positions, directions = _rays(200)
    with torch.no_grad():
        here, there = (field.parts(positions + step * directions, directions) for step in (0.0, 0.05))
    torch.testing.assert_close(there.hits, here.hits - 0.05, atol=1e-12, rtol=0)
    torch.testing.assert_close(there.logits, here.logits, atol=1e-9, rtol=0)


def test_gradient_is_exact_and_satisfies_the_eikonal_equation(field):
    positions, directions = _rays(40)
    part = torch.randint(8, (40,), generator=torch.Generator().manual_seed(2))
    found = field.decoder.depth_gradient(field.views, positions, directions, part)
    torch.testing.assert_close((found * directions).sum(-1), -torch.ones(40).double(), atol=1e-9, rtol=0)

    def hit(at):
        entry, step, _ = field.decoder.span(at, directions)
        middle = entry + (part + 0.5) * step
        there = at + middle[:, None] * directions
        answers = field.decoder.answers(field.views, torch.zeros_like(part), there, directions)
        return middle + (answers[:, 1] - 0.5) * step

    for axis in np.eye(3):
        move = 1e-7 * torch.from_numpy(axis)
        slope = (hit(positions + move) - hit(positions - move)) / 2e-7
        torch.testing.assert_close(found @ torch.from_numpy(axis), slope, atol=1e-5, rtol=1e-5)


def test_nothing_is_where_the_image_is_transparent(field):
    positions, directions = _rays(300)
    parts = field.parts(positions, directions)
    line, part = (parts.logits[0] > line_field.EMPTY).nonzero().unbind(-1)
    assert 0 < len(line) < parts.logits.numel() / 2
    middle = (parts.entry + (part.new_tensor(range(8)) + 0.5)[:, None] * parts.step)[part, line]
    camera = field.views.cameras[0, 0]
    at = line_field.BENCHMARK_FROM_FIELD * (positions[line] + middle[:, None] * directions[line])
    column, row = (each / cameras.IMAGE_SIZE for each in cameras.project(at, *cameras.extrinsics(*camera)))
    size = field.views.opaque.shape[-1]
    assert bool((field.views.opaque[0, 0, (row * size).long(), (column * size).long()] > 0).all())


def test_looks_at_several_maps_are_looks_at_each():
    generator = torch.Generator().manual_seed(3)
    maps, pixels = torch.rand((3, 2, 6, 6), generator=generator), torch.rand((50, 2), generator=generator) * 2.6 - 1.3
    row = torch.randint(3, (50,), generator=generator)
    found = line_field._asked(maps, row, pixels)
    each = functional.grid_sample(maps[row], pixels[:, None, None], align_corners=False)[:, :, 0, 0]
    torch.testing.assert_close(found, each, atol=1e-5, rtol=1e-5)


def test_an_image_seen_twice_says_what_it_says_once(field):
    twice = line_field.Views(*(torch.cat((part, part), dim=1) for part in field.views))
    positions, directions = _rays(50)
    once, both = (field.decoder(views, positions[None], directions[None]) for views in (field.views, twice))
    torch.testing.assert_close(once.logits, both.logits)
    torch.testing.assert_close(once.hits, both.hits)


def test_lines_are_cut_where_they_enter_and_leave_the_box(field):
    positions, directions = _rays(100)
    entry, step, meets = field.decoder.span(3 * positions, directions)
    away = 3 * positions - 20 * directions
    far, _, entered = rays.enter_box(away.numpy(), directions.numpy(), field.lower, field.upper)
    assert 5 < entered.sum() < 95 and (meets.numpy() == entered).all()
    start = 3 * positions + entry[:, None] * directions
    end = start + 8 * step[:, None] * directions
    np.testing.assert_allclose(start.numpy()[entered], far[entered], atol=1e-9)
    assert (end.abs().amax(-1)[meets] - 1).abs().max() < 1e-9


def test_a_depth_lies_in_the_part_so_many_steps_behind_the_entry():
    depth, entry, step = torch.tensor([[0.7, 0.1], [0.1, 0.2], [0.25, 0.5]])
    assert line_field.part_of(depth, entry, step).tolist() == [2, -1]


def test_points_moved_between_cameras_keep_their_pixels():
    positions, directions = _rays(20)
    camera, other = torch.tensor([[[0.3, 0.4, 0.8]], [[0.5, 0.3, 0.9]]], dtype=torch.float64)
    moved, turned = line_steps.turned(positions[None], directions[None], camera, other)
    unit = line_field.BENCHMARK_FROM_FIELD
    for start, end in ((positions, moved[0]), (positions + directions, moved[0] + turned[0])):
        seen = cameras.project(unit * start, *cameras.extrinsics(*camera[0]))
        again = cameras.project(unit * end, *cameras.extrinsics(*other[0]))
        torch.testing.assert_close(torch.stack(again), torch.stack(seen))


def test_the_box_holds_what_the_training_shapes_reach_with_a_margin():
    model, place = _hand_made.line_model(CONFIG), transforms.Similarity(4.0)
    model.fit_box(category_data.ShapeSet.of(["a"], [place], [np.array([[0.1, -0.2, 0.05]])]))
    assert model.decoder.upper.tolist() == pytest.approx([0.3, 0.5, 0.2])


def test_steps_lower_the_loss_and_reach_every_parameter():
    model, images, shapes = _hand_made.line_model(CONFIG), _hand_made.images(), _hand_made.shapes()
    model.fit_box(shapes)
    assert bool((model.decoder.upper <= 1).all()) and bool((model.decoder.upper > line_field.MARGIN).all())
    given = (model, images, shapes, _hand_made.samples(), _hand_made.TRAIN, CONFIG, 0)
    _hand_made.assert_learns(model, lambda: line_steps.ddf_image_step(*given)[0])


def test_a_field_of_an_image_is_asked_as_any_other(field):
    assert isinstance(field, framed_field.FramedField)
    found, evaluated = framed_field.render(field, (30.0, 25.0, 1.2), 16)
    seen = found["visibility"] > framed_field.SEEN
    assert 0 < evaluated <= 16 * 16 and seen.any() and np.isfinite(found["depth"][seen]).all()
    np.testing.assert_allclose(np.linalg.norm(found["normals"][seen], axis=-1), 1, atol=1e-6)
