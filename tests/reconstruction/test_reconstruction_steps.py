"""Batches, steps and reconstruction of small models on hand-made data."""

import dataclasses
from pathlib import Path

import _models
import numpy as np
import pytest
import torch

from ddf.core import checks, resume, storage
from ddf.data import packing, shapenet
from ddf.fields import cloud_projection, losses, pddf
from ddf.geometry import cameras, transforms
from ddf.reconstruction import (
    category_data,
    inference,
    reconstruction_models,
    scales,
    settings,
    silhouettes,
    training_steps,
)
from ddf.training import chamfer_loss

TRAIN = _models.TRAIN
PLACES = [(0, 0), (0, 1), (1, 0)]  # of the shapes: shard, and row in it
COUNTS = {"E": 3, "U": 6, "A": 6, "B": 4, "S": 4, "T": 4, "O": 4, "A+": 5}
FIELD = pddf.PDDFConfig((12, 12), 3.0, 1.0, "softplus", 20.0)
DDF = settings.DDFConfig(FIELD, 5, 2e-3, COUNTS, _models.WEIGHTS, 1.0, 10.0, 16, 20, None)
PCSIREN = settings.PCSirenConfig((12, 12), 3.0, 1.0, 5, 50, 70)
CLOUD = cloud_projection.CloudConfig(8, 2, 0.1, 0.0, 0.0, (), None, 0.05, 0.05, 1000)
POINTCLOUDS = settings.PointcloudsConfig(
    CLOUD,
    settings.CorrectionConfig(2, 0.05, 16, settings.CAMERA_NUMBERS),
    (0.0,),
    None,
    None,
    60,
    30,
    None,
    2,
    12,
    0,
)


def _images(count=6, shapes=3):
    generator = torch.Generator().manual_seed(0)
    images = (torch.rand(count, 4, 32, 32, generator=generator) * 255).to(torch.uint8)
    poses = torch.rand(count, 3, generator=generator) * torch.tensor([6.0, 0.1, 0.3]) + torch.tensor([0.0, 0.45, 0.65])
    ids = [f"shape{i}" for i in range(shapes)]
    return category_data.ImageSet(ids, [i % 5 for i in range(count)], np.arange(count) % shapes, images, poses)


def _shapes(count=3):
    random = np.random.default_rng(0)
    clouds = [torch.from_numpy(random.uniform(-1, 1, (80, 3))).float() for _ in range(count)]
    frames = [transforms.Similarity(2.0 + i) for i in range(count)]
    return category_data.ShapeSet([f"shape{i}" for i in range(count)], frames, clouds)


def _samples(shapes=3, stored=40):
    """Every sample of shape i has depth (i + 1)/4, so that a mix-up of shapes shows."""
    random = np.random.default_rng(1)
    arrays = {}
    for kind in packing.KINDS:
        directions = random.standard_normal((shapes, stored, 3))
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        depth = np.repeat((np.arange(shapes) + 1)[:, None] / 4.0, stored, axis=1)
        depth[:, ::4] = np.inf
        arrays[f"{kind}.positions"] = packing.encode_positions(random.uniform(-1, 1, (shapes, stored, 3)))
        arrays[f"{kind}.directions"] = packing.encode_unit(directions, np.int16)
        arrays[f"{kind}.depth"] = packing.encode_depth(depth)
        arrays[f"{kind}.normals"] = packing.encode_unit(-directions, np.int8)
    first = {name: values[:2] for name, values in arrays.items()}
    return category_data.SampleSet([first, {name: values[2:] for name, values in arrays.items()}], PLACES[:shapes])


def test_drawn_samples_belong_to_their_shapes_and_types():
    batch = _samples().draw(np.array([2, 0]), COUNTS, np.random.default_rng(0))
    known = batch.span(*losses.GROUND_TRUTH)
    assert batch.positions.shape == (2, sum(COUNTS.values()), 3)
    torch.testing.assert_close(batch.directions.norm(dim=-1), torch.ones(2, sum(COUNTS.values())), atol=1e-5, rtol=0)
    for row, depth in ((0, 0.75), (1, 0.25)):
        seen = batch.visible[row, known] == 1
        assert 0 < int(seen.sum()) < len(seen)
        torch.testing.assert_close(
            batch.depth[row, known][seen], torch.full((int(seen.sum()),), depth), atol=1e-4, rtol=0
        )
        assert bool((batch.depth[row, known][~seen] == 0).all())
    cosine = (batch.normals * batch.directions).sum(-1)[:, known]
    assert float(cosine.max()) < -0.99


def test_shards_give_what_was_written_however_many_are_open(tmp_path, monkeypatch):
    monkeypatch.setattr(category_data, "OPEN_SHARDS", 1)
    ids, samples = [f"shape{i}" for i in range(3)], _samples()
    points = [np.random.default_rng(i).random((5 + i, 3)).astype(np.float32) for i in range(3)]
    for number, rows in enumerate(([0, 1], [2])):
        names = [ids[i] for i in rows]
        frames = {name: transforms.Similarity(2.0 + i).to_dict() for i, name in zip(rows, names, strict=True)}
        written = {f"{number}{category_data.SAMPLES}": "", f"{number}{category_data.CLOUDS}": ""}
        path = tmp_path / f"{number}{category_data.SAMPLES}"
        storage.save_tensors(path, samples.shards[number], {"ids": names, "field_from_raw": frames})
        arrays = {"points": np.concatenate([points[i] for i in rows])}
        arrays["offsets"] = np.cumsum([0, *(len(points[i]) for i in rows)])
        storage.save_tensors(tmp_path / f"{number}{category_data.CLOUDS}", arrays, {"ids": names})
        storage.write_json(tmp_path / f"{number:03d}.json", {"files": written})
    read, shapes = category_data.read_samples(tmp_path, ids[::-1]), category_data.read_shapes(tmp_path, ids[::-1])
    drawn = (
        whole.draw(np.array(order), COUNTS, np.random.default_rng(0))
        for whole, order in ((samples, [2, 0, 1]), (read, [0, 2, 1]))
    )
    for one, two in zip(*(vars(batch).values() for batch in drawn), strict=True):
        assert torch.equal(one, two) if isinstance(one, torch.Tensor) else one == two
    for i in range(3):
        torch.testing.assert_close(shapes.clouds[i], torch.from_numpy((4.0 - i) * points[2 - i]), rtol=1e-6, atol=0)
    _flip_last_byte(tmp_path / f"1{category_data.CLOUDS}")
    with pytest.raises(checks.InputError, match=r"1\.clouds\.safetensors is damaged"):
        category_data.read_shapes(tmp_path, ids)
    with pytest.raises(checks.InputError, match="no samples of shape other"):
        category_data.read_samples(tmp_path, [*ids, "other"])


def test_images_come_back_from_their_file():
    bytes_of = torch.randint(0, 256, (3, 5, 5, 4), generator=torch.Generator().manual_seed(0)).to(torch.uint8)
    file = category_data.ImageFile(5)
    for image in bytes_of:
        file.append(image.permute(2, 0, 1).float() / 255)  # as pictures are read: not contiguous
    whole = bytes_of.permute(0, 3, 1, 2)
    poses = torch.zeros(3, 3)
    read, kept = (category_data.ImageSet(["a"], [0, 1, 2], np.zeros(3, int), images, poses) for images in (file, whole))
    rows = np.array([2, 0, 2])
    assert torch.equal(read.batch(rows), whole[rows].float() / 255)
    assert torch.equal(read.alpha(rows, 2), kept.alpha(rows, 2)) and read.digest() == kept.digest()


def _flip_last_byte(path):
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))


def test_same_step_draws_the_same_batch_and_another_does_not():
    draws = [training_steps.Batch.draw(_images(), TRAIN, step) for step in (3, 3, 4)]
    assert np.array_equal(draws[0].rows, draws[1].rows)
    assert not np.array_equal(draws[0].random.random(9), draws[2].random.random(9))
    assert len(set(draws[0].rows)) == 4


@pytest.mark.parametrize("kind", ["ddf", "pcsiren"])
def test_steps_lower_the_loss_and_reach_every_parameter(kind):
    torch.manual_seed(0)
    images, shapes = _images(), _shapes()
    if kind == "ddf":
        model = reconstruction_models.ddf_model(TRAIN, DDF)
        model.camera_head.fit(images.cameras)
        samples = _samples()

        def step(k):
            return training_steps.ddf_step(model, images, shapes, samples, TRAIN, DDF, k)
    else:
        model = reconstruction_models.pcsiren_model(TRAIN, PCSIREN)
        model.camera_head.fit(images.cameras)

        def step(k):
            return training_steps.pcsiren_step(model, images, shapes, TRAIN, PCSIREN, k)

    loss, terms = step(0)
    loss.backward()
    dead = [name for name, p in model.named_parameters() if p.grad is None or not bool(p.grad.abs().sum() > 0)]
    assert dead == []
    assert {"camera"} < set(terms)
    optimiser = torch.optim.Adam(model.parameters(), lr=3e-3)
    before = float(loss.detach())
    for _ in range(30):
        optimiser.zero_grad()
        loss, _ = step(0)
        loss.backward()
        optimiser.step()
    assert float(loss.detach()) < 0.8 * before if before > 0 else float(loss.detach()) < before


def test_chamfer_loss_equals_the_double_loop():
    generator = torch.Generator().manual_seed(0)
    a = torch.randn(2, 7, 3, generator=generator, dtype=torch.float64, requires_grad=True)
    b = torch.randn(2, 5, 3, generator=generator, dtype=torch.float64)
    distance = torch.cdist(a, b).square()
    expected = distance.amin(2).mean() + distance.amin(1).mean()
    torch.testing.assert_close(chamfer_loss.chamfer_loss(a, b), expected)
    assert torch.autograd.gradcheck(lambda x: chamfer_loss.chamfer_loss(x, b), (a,))


def test_chamfer_loss_is_the_same_in_blocks(monkeypatch):
    generator = torch.Generator().manual_seed(1)
    a, b = torch.randn(3, 40, 3, generator=generator), torch.randn(3, 90, 3, generator=generator)
    whole = chamfer_loss.chamfer_loss(a, b)
    for block in (1, 40 * 7, 40 * 90, 2 * 40 * 90):  # a column, seven, a shape, two shapes at a time
        monkeypatch.setitem(losses.BLOCK_VALUES, "cpu", block)
        assert chamfer_loss.chamfer_loss(a, b) == whole


@pytest.mark.parametrize(("count", "others"), [(7, 33), (40, 96), (1, 5), (64, 32)])
def test_nearest_points_are_those_of_all_distances(count, others):
    """Whole numbers as coordinates: many distances are equal, and of these the first one counts."""
    generator = torch.Generator().manual_seed(0)
    a, b = (torch.randint(-2, 3, (3, size, 3), generator=generator).float() for size in (count, others))
    dist_sq = (a[:, :, None] - b[:, None]).square().sum(-1)
    to_truth, to_predicted = chamfer_loss._nearest(a, b)
    assert torch.equal(to_truth, dist_sq.argmin(2))
    assert torch.equal(to_predicted, dist_sq.argmin(1))


def test_training_views_never_show_a_test_view():
    entries = (shapenet.ShapeEntry("a", (0, 1, 2, 3, 4), ()), shapenet.ShapeEntry("b", (0, 1), (2, 3, 4)))
    unseen = shapenet.ShapeEntry("c", (), (0, 1, 2, 3, 4))
    dataset = shapenet.Dataset(Path("root"), {"chair": shapenet.CategoryEntry("1", (*entries, unseen))})
    assert category_data.training_views(dataset, "chair", 7) == [("a", [0, 1, 2, 3, 4, 5, 6]), ("b", [0, 1, 5, 6])]
    assert category_data.training_views(dataset, "chair", None) == [("a", (0, 1, 2, 3, 4)), ("b", (0, 1))]
    assert category_data.test_views(dataset, "chair", 2) == [("b", (2, 3)), ("c", (0, 1))]


def test_scale_makes_the_box_diagonal_one():
    points = torch.tensor([[0.0, 0.0, 0.0], [1.0, 2.0, 2.0], [0.5, 1.0, 1.0]])
    assert scales.scale_from_cloud(points) == pytest.approx(1 / 3)
    with pytest.raises(checks.InputError, match="one point"):
        scales.scale_from_cloud(points[:1])


def test_scale_from_all_candidates_leaves_out_strays_and_keeps_doubtful_tips():
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(4000, 3, generator=generator)
    confidence = torch.ones(4000)
    tip = torch.rand(200, 3, generator=generator) * torch.tensor([0.0, 1.0, 1.0]) + torch.tensor([2.0, 0.0, 0.0])
    stray = torch.tensor([[9.0, 0.0, 0.0], [-9.0, 0.0, 0.0]])

    def scale(extra, sure, quantile=0.002):
        pool = torch.cat((points, extra)), torch.cat((confidence, torch.full((len(extra),), sure)))
        return scales.scale_from_cycles([cloud_projection.ProjectedPoints(pool[0], pool[1], pool[1])], quantile)

    clean = scale(stray[:0], 1.0)
    assert clean == pytest.approx(1 / 3**0.5, rel=1e-2)
    assert scale(stray, 1.0) == pytest.approx(clean, rel=2e-3)
    assert scale(tip, 0.2) == pytest.approx(1 / 6**0.5, rel=2e-2)
    assert scale(stray, 1.0, 0.0) == pytest.approx(1 / (18**2 + 2) ** 0.5, rel=1e-3)


def test_reconstruction_has_the_promised_arrays():
    torch.manual_seed(0)
    model = reconstruction_models.ddf_model(TRAIN, DDF).eval()
    images = _images()
    model.camera_head.fit(images.cameras)
    tensors, facts = inference.reconstruct_ddf(model, images, POINTCLOUDS, "test")
    shapes = {name: tuple(values.shape) for name, values in tensors.items()}
    assert {k: v for k, v in shapes.items() if k[0] in "LS"} == {
        "L.h2": (6, 60, 3), "S.h2": (6, 30, 3), "L.h1": (6, 60, 3), "S.h1": (6, 30, 3)
    }  # fmt: skip
    assert shapes["camera_pred"] == shapes["camera_corrected"] == (6, 3)
    assert shapes["render.normals"] == (2, 12, 12, 3)
    assert facts["rendered"] == [0, 5]
    assert torch.equal(tensors["features"], inference.image_features(model, images))
    again, _ = inference.reconstruct_ddf(model, images, POINTCLOUDS, "test")
    for name, values in tensors.items():
        assert torch.equal(values, again[name]), name
    spans = (tensors["L.h2"].amax(1) - tensors["L.h2"].amin(1)).norm(dim=-1)
    torch.testing.assert_close(tensors["scale_pred"], 1 / spans)


CORRECTED = dataclasses.replace(POINTCLOUDS, shape_correction=settings.ShapeCorrectionConfig(2, 0.1, 0.05, 0.0, 16))


def test_images_at_a_time_change_no_bit(monkeypatch):
    model, images, deviation = _models.ddf_model("angle"), _images(), torch.ones(TRAIN.latent_features)
    results = []
    for cores in (1, 3):
        usable = range(cores * torch.get_num_threads())
        monkeypatch.setattr(inference.os, "sched_getaffinity", lambda _, usable=usable: usable, raising=False)
        monkeypatch.setattr(inference, "CORRECTION_BATCH", 2)
        results.append(inference.reconstruct_ddf(model, images, CORRECTED, "test", deviation)[0])
    for name, values in results[0].items():
        assert torch.equal(values, results[1][name]), name


def test_killed_reconstruction_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    model, images, deviation = _models.ddf_model("angle"), _images(), torch.ones(TRAIN.latent_features)
    monkeypatch.setattr(inference, "CORRECTION_BATCH", 2)
    monkeypatch.setattr(inference, "_threads_at_once", lambda: 1)
    whole, _ = inference.reconstruct_ddf(model, images, CORRECTED, "test", deviation)
    sample, drawn = cloud_projection.sample, []

    def count(field, modulations, count, *rest):
        drawn.append(count)
        if drawn.count(CORRECTED.large) == 4:  # the second of the second portion
            raise KeyboardInterrupt
        return sample(field, modulations, count, *rest)

    monkeypatch.setattr(cloud_projection, "sample", count)
    kept = resume.Kept(tmp_path, "key")
    with pytest.raises(KeyboardInterrupt):
        inference.reconstruct_ddf(model, images, CORRECTED, "test", deviation, kept)
    stopped = len(drawn)
    resumed, facts = inference.reconstruct_ddf(model, images, CORRECTED, "test", deviation, kept)
    assert drawn[stopped:] == [CORRECTED.large] * 4  # neither a first portion nor a shape's correction once more
    assert resumed.keys() == whole.keys()
    for name, values in whole.items():
        assert torch.equal(values, resumed[name]), name
    assert min(facts["cloud_seconds_per_image"], facts["shape_correction_seconds_per_image"]) > 0


def test_corrected_shapes_have_other_clouds_from_the_same_predicted_cameras():
    model, images = _models.ddf_model("angle"), _images()
    deviation = silhouettes.deviation(model, inference.image_features(model, images))
    plain, _ = inference.reconstruct_ddf(model, images, POINTCLOUDS, "test")
    moved, facts = inference.reconstruct_ddf(model, images, CORRECTED, "test", deviation)
    assert plain.keys() == moved.keys()
    assert {name for name in plain if torch.equal(plain[name], moved[name])} == {"features", "camera_pred"}
    assert facts["shape_correction_seconds_per_image"] > 0
    with pytest.raises(ValueError, match="needs the deviation"):
        inference.reconstruct_ddf(model, images, CORRECTED, "test")


@pytest.mark.parametrize("quantile", [None, 0.002])
def test_a_correction_starts_from_the_scale_that_a_small_cloud_tells(quantile, monkeypatch):
    model, images, seen = _models.ddf_model("angle"), _images(), []
    correct = silhouettes.correct_shapes
    monkeypatch.setattr(silhouettes, "correct_shapes", lambda *given: seen.append(given[4]) or correct(*given))
    config = dataclasses.replace(CORRECTED, scale_quantile=quantile)
    inference.reconstruct_ddf(model, images, config, "test", torch.ones(TRAIN.latent_features))
    tensors, _ = inference.reconstruct_ddf(
        model, images, dataclasses.replace(config, shape_correction=None, large=inference.ROUGH_POINTS), "test"
    )
    torch.testing.assert_close(torch.cat(seen), 1 / tensors["scale_pred"])


def test_an_error_of_one_image_comes_through(monkeypatch):
    monkeypatch.setattr(cloud_projection, "select", lambda *_: pytest.fail("no cloud"))
    with pytest.raises(pytest.fail.Exception, match="no cloud"):
        inference.reconstruct_ddf(_models.ddf_model("angle"), _images(), POINTCLOUDS, "test")


@pytest.mark.parametrize("azimuth", ["angle", "sincos"])
def test_with_a_mirror_an_image_and_its_flipped_image_have_one_latent_and_mirrored_cameras(azimuth):
    model, images = _models.ddf_model(azimuth), _images().batch(np.arange(6))
    features, latents, seen = inference.encode_batch(model, images, "z")
    _, other_latents, other = inference.encode_batch(model, images.flip(-1), "z")
    torch.testing.assert_close(other_latents, latents)
    torch.testing.assert_close(other, cameras.mirrored(seen, "z"))
    alone, one, camera = inference.encode_batch(model, images)
    _, two, flipped = inference.encode_batch(model, images.flip(-1))
    assert torch.equal(features, alone)
    assert float((one - two).abs().max()) > 1e-3
    torch.testing.assert_close(latents, (one + two) / 2)
    torch.testing.assert_close(seen, cameras.between(camera, cameras.mirrored(flipped, "z")))


def test_both_models_are_reconstructed_from_what_the_mirror_gives():
    settings, images = dataclasses.replace(POINTCLOUDS, mirror="z"), _images()
    ddf, pcsiren = _models.ddf_model(), _models.pcsiren_model()
    both = [
        (
            inference.reconstruct_ddf(ddf, images, config, "test")[0],
            inference.reconstruct_pcsiren(pcsiren, images, config)[0],
        )
        for config in (settings, POINTCLOUDS)
    ]
    for own, alone, model, size in zip(*both, (ddf, pcsiren), ("L.h2", "L"), strict=True):
        torch.testing.assert_close(own["camera_pred"], inference.encode(model, images, "z")[2])
        assert not torch.equal(own[size], alone[size])


def test_pcsiren_reconstruction_is_the_decoder_on_random_seeds():
    torch.manual_seed(0)
    model = reconstruction_models.pcsiren_model(TRAIN, PCSIREN).eval()
    model.camera_head.fit(_images().cameras)
    tensors, _ = inference.reconstruct_pcsiren(model, _images(), POINTCLOUDS)
    assert tuple(tensors["L"].shape) == (6, 60, 3)
    assert torch.equal(tensors["S"], tensors["L"][:, :30])
    assert not torch.equal(tensors["L"][0], tensors["L"][3])  # same shape, another image


def test_even_points_fill_the_cube_and_random_ones_are_the_plain_draw():
    drawn = inference.cube_points(5, "random", torch.Generator().manual_seed(3))
    assert torch.equal(drawn, torch.rand((5, 3), generator=torch.Generator().manual_seed(3)) * 2 - 1)
    found = {}
    for how in ("random", "even"):
        points = inference.cube_points(4096, how, torch.Generator().manual_seed(3))
        assert points.dtype == torch.float32 and float(points.abs().max()) <= 1
        for part in (points[:512], points):  # of S as of L
            cells = ((part + 1) * 4).long().clamp(0, 7)  # 512 of them
            counts = torch.bincount(cells @ torch.tensor([64, 8, 1]), minlength=512).double()
            found[how, len(part)] = float(counts.var()) / (len(part) / 512)  # 1 for independent points
    assert all(found["even", count] < 0.5 * found["random", count] for count in (512, 4096))
    first, second = (inference.cube_points(9, "even", torch.Generator().manual_seed(i)) for i in (0, 1))
    assert not torch.equal(first, second)  # another image, another shift


def test_pcsiren_maps_the_points_that_the_section_names():
    model, images = _models.pcsiren_model(), _images()
    clouds = [
        inference.reconstruct_pcsiren(model, images, dataclasses.replace(POINTCLOUDS, pcsiren_inputs=how))[0]["L"]
        for how in ("random", "even")
    ]
    assert not torch.equal(*clouds)


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        (TRAIN, {"batch_size": 1}, "train.batch_size must be >= 2; got 1"),
        (TRAIN, {"train_views": 25}, r"train.train_views must be in 1..24 or null; got 25"),
        (TRAIN, {"step_shares": {"cars": 1.5}}, "train.step_shares must name categories; got 'cars'"),
        (TRAIN, {"step_shares": {"car": 0.0}}, "train.step_shares.car must be > 0 and finite; got 0.0"),
        (DDF, {"counts": {"U": 3}}, "ddf.counts must give each of E, U, A, B, S, T, O"),
        (DDF, {"mask_pixels": 0}, "ddf.mask_pixels must be >= 1"),
        (PCSIREN, {"points": 0}, "pcsiren.points must be >= 1; got 0"),
        (POINTCLOUDS, {"correction_turns": ()}, r"pointclouds.correction_turns must list degrees.*got \[\]"),
        (POINTCLOUDS, {"correction_limit": 0.0}, "pointclouds.correction_limit must be > 0, or null; got 0.0"),
        (POINTCLOUDS, {"small": 61}, "1 <= small <= large; got 61 and 60"),
    ],
)
def test_values_out_of_range_are_named(section, change, message):
    with pytest.raises(checks.InputError, match=message):
        dataclasses.replace(section, **change)


def test_a_category_may_have_a_share_of_the_steps():
    assert TRAIN.steps(100, "car") == 100
    shared = dataclasses.replace(TRAIN, step_shares={"car": 1.45, "chair": 0.001})
    assert [shared.steps(100, name) for name in ("car", "plane", "chair")] == [145, 100, 1]


def test_own_learning_rates_replace_those_of_the_loop():
    assert DDF.loop(TRAIN.loop) == dataclasses.replace(TRAIN.loop, learning_rate=2e-3)
    assert dataclasses.replace(DDF, learning_rate=None).loop(TRAIN.loop) == TRAIN.loop
    muon = dataclasses.replace(DDF, muon=0.02)
    assert muon.loop(TRAIN.loop) == dataclasses.replace(TRAIN.loop, learning_rate=2e-3, muon=0.02)
    common = dataclasses.replace(TRAIN.loop, muon=0.01)
    assert (DDF.loop(common).muon, muon.loop(common).muon) == (0.01, 0.02)
    for name in ("learning_rate", "muon"):
        with pytest.raises(checks.InputError, match=f"ddf.{name} must be > 0, or null; got 0.0"):
            dataclasses.replace(DDF, **{name: 0.0})


def test_encoders_may_learn_at_a_share_of_the_decoders_rate():
    assert DDF.encoder_share(TRAIN.loop) == 1
    slow = dataclasses.replace(DDF, encoder_learning_rate=5e-4)
    assert slow.encoder_share(TRAIN.loop) == pytest.approx(0.25)  # of the DDF's own 2e-3
    assert dataclasses.replace(slow, learning_rate=None).encoder_share(TRAIN.loop) == pytest.approx(
        5e-4 / TRAIN.loop.learning_rate
    )
    with pytest.raises(checks.InputError, match=r"ddf\.encoder_learning_rate must be > 0, or null; got 0"):
        dataclasses.replace(DDF, encoder_learning_rate=0.0)
