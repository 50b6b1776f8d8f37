"""Completion of real shapes from one scan: `ddf complete` beside what the same model makes of an image at the true
camera, beside the mean and the nearest training shape, laid over the hits by ICP, and beside signed distances.

Scans are of one view of each public shape: a depth image of 64 x 64 pixels, noiseless, with noise of 1 or 2 % of the
shape's diagonal, or with a tenth of outliers, and 496 rays of a lidar of 16 beams. The pose is known, but for `pose
off`, where it is off by 30 degrees about a random axis, by 10 % of the size, and by 5 % of it in place.

ICP takes 10 steps, trimmed. Of 10 validation shapes of each category, 60 steps gave F 36.2 for 36.2 (chairs) and 97.6
for 96.9 (planes); all hits no more.

`sdf`: as `depth`, by a descent of as many steps, on 200 hits and 200 points before hits, on the latent of signed
distances (`latent_distances`), trained on the shapes of `--run` unless its folder holds them trained; in two settings,
each the better one of a category.

Errors: D_C and F(τ) as in the tables, with 2,466 points at the true scale, and those of every shape (`each`); the
paired difference of F to the image, to the nearest shape and to signed distances, with its standard error; coverage of
intervals of 50 and 90 % on all rays of another view that hit the shape, and their median widths, half longest sides;
the median spread of seen and of inferred points of the cloud, in these, and of seen ones over the noise; of the pose,
median angle, and median error of the scale in percent. Evaluations: thousands of rays, or points, that the
field was asked for. Seconds are processor time of one thread, without clouds. Settings were chosen with `--split
validation`.
"""

import contextlib
import dataclasses
import functools
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from PIL import Image
from scipy.spatial.transform import Rotation
from torch import Tensor

from bench.lib import measuring
from bench.rivals import latent_distances
from ddf.api import completion as whole
from ddf.api import sensors as sending
from ddf.core import shipped_models
from ddf.data import shapenet, true_clouds
from ddf.data.public import manifest, packages, shapes
from ddf.data.samples.draws import Surface
from ddf.data.synthetic import assemble, render, write
from ddf.fields import cloud_projection, pddf
from ddf.fit import completed_surface, completion, latent_prior
from ddf.geometry import cameras, neighbours, scans, sensors, transforms
from ddf.geometry.mesh_io import Mesh
from ddf.metrics import cloud_scores
from ddf.models import line_field
from ddf.reconstruction import line_clouds
from ddf_lab.evaluation import claims
from ddf_lab.run import Run

KEPT = True  # rows that are not measured anew
SEED, PIXELS, POINTS, TRUTH_POINTS = 0, 64, 2466, 8000
SCORES = ("chamfer_l2_sq_x1000", "f_score_tau_x100")
EACH = (*SCORES, "coverage_90", "width_90", "spread_seen", "spread_inferred")  # kept of every shape
Split = Literal["validation", "test"]
BEAMS, COLUMNS, TEST_RAYS, JUDGED = 16, 31, 500, 20
TURN_DEG, GROWTH, SHIFT = 30.0, 0.1, 0.1  # half longest sides
ICP_HITS, ICP_STEPS, ICP_POINTS, ICP_KEPT = 300, 10, 2000, 0.9  # share of hits that a step fits to
K = transforms.BENCHMARK_FROM_V1
SCANS = {  # noise in v1, outliers, whether a lidar, whether the pose is known
    "depth": (0.0, 0.0, False, True),
    "depth, 1 % noise": (0.01, 0.0, False, True),
    "depth, 2 % noise": (0.02, 0.0, False, True),
    "depth, 10 % outliers": (0.0, 0.1, False, True),
    "lidar": (0.0, 0.0, True, True),
    "depth, pose off": (0.0, 0.0, False, False),
}
SETTINGS = {"sdf": (9000, 0.1), "sdf, 4000 steps, prior 0.01": (4000, 0.01)}  # steps of training, λ of the descent
EVERY = ("depth", "depth, pose off")  # of all shapes; others of `--few`
LINES = (": image", ": nearest", ": sdf", ": depth", ": lidar", ": depth, pose off", ": told apart")  # of the page


@dataclass(frozen=True)
class Case:
    """A shape in v1, its cloud in benchmark units, where its cube lies, two cameras and the image of the first."""

    shape: assemble.Shape
    truth: neighbours.Neighbours
    place: transforms.Similarity
    views: list[render.View]

    def image(self, folder: Path) -> Path:
        """The file, written, of the first view's image."""
        file = folder / "view.png"
        Image.fromarray(render.Renderer(self.shape).render(self.views[0])).save(file)
        return file

    def seen_from(self, view: int) -> Float[Tensor, "3"]:
        """A view's camera: azimuth, elevation (radians), radius (benchmark units)."""
        seen = self.views[view]
        return torch.tensor([*np.radians([seen.azimuth_deg, seen.elevation_deg]), seen.ratio], dtype=torch.float32)

    def sensor(self, view: int, axes: Float[np.ndarray, "3 3"] = sensors.CAMERA) -> transforms.Similarity:
        """Where one stands at a view's camera, in v1."""
        seen = self.views[view]
        azimuth, elevation = np.radians([seen.azimuth_deg, seen.elevation_deg])
        turn, centre = cameras.extrinsics(azimuth, elevation, np.array(seen.ratio))
        return transforms.Similarity(1.0, turn.T @ axes, centre / K)

    def scan(self, view: int, noise: float = 0.0, outliers: float = 0.0, lidar: bool = False) -> sensors.Sweep:
        """What a sensor at a view's camera sees."""
        seen = self.views[view]
        pose = self.sensor(view, sensors.LIDAR if lidar else sensors.CAMERA).to_matrix()
        mesh = Mesh(self.shape.vertices, self.shape.triangles)
        if lidar:
            half = float(np.degrees(np.arcsin(min(1.0, K / 2 / seen.ratio))))  # what holds the whole shape
            fan = functools.partial(sending.lidar, elevation_deg=(-half, half), azimuth_deg=(-half, half))
            return fan(mesh, pose, beams=BEAMS, columns=COLUMNS, noise=noise, outliers=outliers)
        focal = cameras.FOCAL_PX * PIXELS / cameras.IMAGE_SIZE
        lens = [[focal, 0, PIXELS / 2], [0, focal, PIXELS / 2], [0, 0, 1]]
        return sending.depth_camera(mesh, pose, size=PIXELS, intrinsics=lens, noise=noise, outliers=outliers)


@functools.cache
def shape(row: manifest.Row) -> assemble.Shape:
    """Of a row, from its kept package."""
    kept = packages.require(packages.PACKAGES[row.package], manifest.wanted(row.package))
    with packages.reading(kept) as archive:
        return shapes.shape(shapes.load(archive, row))


def case(row: manifest.Row) -> Case:
    """Of a public shape."""
    made = shape(row)
    cloud, _ = true_clouds.poisson_disk(Mesh(made.vertices, made.triangles), TRUTH_POINTS, np.random.default_rng(SEED))
    place = transforms.field_from_mesh(made.vertices).inverse()
    return Case(made, neighbours.Neighbours(cloud * K), place, write.make_views(SEED, row.category, row.id, 2))


@dataclass(frozen=True)
class Solver:
    """Decoder and prior of latents, what reads images, and how scans are completed."""

    decoder: pddf.ConditionalPDDF
    prior: latent_prior.LatentPrior
    images: line_field.TrainedImageDDF
    config: completion.CompletionConfig

    @classmethod
    def of(cls, folder: Path, config: completion.CompletionConfig) -> "Solver":
        """From the model's folder."""
        shapes, images = latent_prior.load(folder), line_field.load(folder)
        images.network.cpu().requires_grad_(False)
        return cls(shapes.decoder, shapes.prior.widest(config.axes), images, config)

    @torch.no_grad()
    def cloud(self, modulations: Sequence[Tensor]) -> Float[np.ndarray, "n 3"]:
        """Of a shape, in its cube."""
        drawn, generator = cloud_projection.USUAL, torch.Generator().manual_seed(SEED)
        cycles = cloud_projection.sample(self.decoder.field, list(modulations), POINTS, drawn, generator)
        return cloud_projection.select(cycles, [POINTS], drawn)[0].double().numpy()

    def of_image(self, given: Case) -> dict[str, float]:
        """What the model makes of the image of the first view, at the true camera and scale."""
        with tempfile.TemporaryDirectory() as folder, torch.no_grad():
            file = given.image(Path(folder))
            started = time.process_time()
            model, size, _ = self.images
            views = model.views(shapenet.read_image(file, size)[None], given.seen_from(0)[None])
            seconds = time.process_time() - started
            field = line_field.ImageField.of(model.decoder, views)
            cloud = line_clouds.draw(field, POINTS, torch.Generator().manual_seed(SEED))
            found = cloud_scores.compare_clouds(cloud.double().numpy() / line_field.FIELD_FROM_V1 * K, given.truth)
        return _told(found) | {"seconds": seconds}

    def of_scan(self, given: Case, name: str, rng: np.random.Generator) -> dict[str, float]:
        """What `SCANS` of that name gives."""
        noise, outliers, lidar, known = SCANS[name]
        scan, place = given.scan(0, noise, outliers, lidar), given.place if known else off(given.place, rng)
        doubt = None if known else completion.Doubt(TURN_DEG / 2, SHIFT, GROWTH)
        with counted(self.decoder.field) as asked:
            started = time.process_time()
            found = completion.complete(
                self.decoder, self.prior, scan, place, doubt, noise, config=self.config, seed=SEED
            )
            told = {"seconds": time.process_time() - started, "explained": found.explained}
        told["evaluations_x1000"] = sum(asked) / 1000
        surface = completed_surface.cloud(self.decoder.field, found, scan, POINTS, SEED)
        if not known:
            told["angle_deg"], told["scale_percent"] = pose_error(found.scan_from_field, given.place)
        else:
            told |= self.coverage(found, given, rng)
            told |= _spread(surface, given.place.scale, noise)
        return told | _told(cloud_scores.compare_clouds(surface.points * K, given.truth))

    def coverage(self, found: completion.Completed, given: Case, rng: np.random.Generator) -> dict[str, float]:
        """Share of true ranges of another view in their intervals, and how wide these are."""
        other = given.scan(1)
        index = rng.permutation(np.flatnonzero(other.hit))[:TEST_RAYS]
        told = {}
        for share in (0.5, 0.9):
            asked = (other.positions[index], other.directions[index])
            low, high = completed_surface.along_rays(self.decoder.field, found, *asked, share)
            inside = (low <= other.ranges[index]) & (other.ranges[index] <= high)
            told[f"coverage_{100 * share:.0f}"] = 100 * float(inside.mean())
            told[f"width_{100 * share:.0f}"] = float(np.nanmedian(high - low)) / given.place.scale
        return told


@contextlib.contextmanager
def counted(field: torch.nn.Module) -> Iterator[list[int]]:
    """Of each call of a field, how many rays or points it is asked for."""
    asked: list[int] = []
    counting = field.register_forward_hook(lambda _, given, raw: asked.append(raw[..., 0].numel()))
    yield asked
    counting.remove()


def by_distances(completer: latent_distances.Completer, given: Case) -> dict[str, float]:
    """What signed distances make of a depth view."""
    scan, rng = given.scan(0), np.random.default_rng(SEED)
    with counted(completer.model.network) as asked:
        started = time.process_time()
        latent = completer.complete(latent_distances.Evidence.of(scan, given.place, rng), SEED)
        told = {"seconds": time.process_time() - started}
    told["evaluations_x1000"] = sum(asked) / 1000
    cloud = latent_distances.cloud(completer.model, latent, POINTS, rng)
    return told | _told(cloud_scores.compare_clouds(given.place.apply(cloud) * K, given.truth))


def pose_error(found: transforms.Similarity, true: transforms.Similarity) -> tuple[float, float]:
    """Angle between two poses, degrees, and by how many percent of the true one the scale is off."""
    cosine = (np.trace(found.rotation.T @ true.rotation) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))), 100 * abs(found.scale / true.scale - 1)


def off(place: transforms.Similarity, rng: np.random.Generator, turn_deg: float = TURN_DEG) -> transforms.Similarity:
    """A pose that is wrong by `turn_deg`, `GROWTH` and `SHIFT`, each one way or the other."""
    axis, way = (each / np.linalg.norm(each) for each in rng.normal(size=(2, 3)))
    turn = Rotation.from_rotvec(-np.radians(turn_deg) * axis).as_matrix()
    return place.compose(transforms.Similarity(1 + GROWTH * rng.choice([-1, 1]), turn, SHIFT * way))


def nearest(given: Case, known: Sequence[Float[np.ndarray, "n 3"]]) -> dict[str, float]:
    """The known shape whose cloud lies nearest to the hits after ICP with a scale; scored as all clouds are.

    Args:
      known: their clouds in v1, where the pose is known up to what differs between shapes.
    """
    hits = given.scan(0).points
    hits = hits[np.random.default_rng(SEED).permutation(len(hits))[:ICP_HITS]]
    started, best = time.process_time(), (np.inf, known[0])
    for cloud in known:
        placed, miss = align(cloud, hits)
        best = min(best, (miss, placed), key=lambda pair: pair[0])
    seconds = time.process_time() - started
    return _told(cloud_scores.compare_clouds(best[1] * K, given.truth)) | {"seconds": seconds}


def align(cloud: Float[np.ndarray, "n 3"], hits: Float[np.ndarray, "m 3"]) -> tuple[np.ndarray, float]:
    """The cloud laid over the hits by trimmed point-to-point ICP with a scale, and their mean distance to it."""
    tree, moved, keep = neighbours.Tree(cloud), hits, max(3, int(ICP_KEPT * len(hits)))
    for _ in range(ICP_STEPS):
        index, dist_sq = (each[:, 0] for each in tree.search(moved, 1))
        kept = np.argsort(dist_sq)[:keep]
        moved = similar(hits[kept], cloud[index[kept]]).apply(hits)
    map_back = similar(moved, hits)
    miss = float(np.sqrt(np.sort(tree.search(moved, 1)[1][:, 0])[:keep]).mean()) * map_back.scale
    return map_back.apply(cloud), miss


def similar(source: Float[np.ndarray, "n 3"], target: Float[np.ndarray, "n 3"]) -> transforms.Similarity:
    """The similarity of least squares."""
    matrix, _, _ = trimesh.registration.procrustes(source, target, reflection=False)
    return transforms.Similarity.of_matrix("similarity", matrix)


def judged(given: Case, category: str) -> dict[str, float]:
    """What `ddf complete` says of a depth view in its camera's frame, and by how much its shape leans."""
    seen, from_scan = given.scan(0), given.sensor(0).inverse()
    starts, ways = from_scan.apply(seen.positions), from_scan.apply_directions(seen.directions)
    started = time.process_time()
    found = whole.complete(scans.Scan(starts, ways, seen.ranges, of_camera=True), category, n=2)
    up = found.pose[:3, 1] / np.linalg.norm(found.pose[:3, 1])
    leans = float(np.degrees(np.arccos(np.clip(up @ from_scan.rotation[:, 1], -1, 1))))
    told = {"likeness": found.likeness, "explained": found.explained, "leans_deg": leans, "warned": found.unlike}
    return {"seconds": time.process_time() - started} | told


def told_apart(category: str, split: Split, most: int) -> measuring.Row:
    """The line of as many shapes of the category at most, and of all others, evenly."""
    everything = manifest.rows()
    right = [row for row in everything if (row.category, row.split) == (category, split)][:most]
    others = [row for row in everything if row.category != category]
    others = [others[(2 * index + (split == "test")) * len(others) // (2 * most)] for index in range(most)]
    own, other = ({row.id: judged(case(row), category) for row in rows} for rows in (right, others))
    warned = [[each["warned"] for each in of.values()] for of in (own, other)]
    leans = np.array([each["leans_deg"] for each in own.values()])
    error = {"right_warned": 100 * float(np.mean(warned[0])), "wrong_warned": 100 * float(np.mean(warned[1]))}
    error |= {"leans_deg": float(np.median(leans)), "upside_down": float((leans > 90).sum())}
    about = {"shapes": len(right), "others": len(others)}
    seconds = [each.pop("seconds") for each in (own | other).values()]
    return measuring.row(f"{category}, {split}: told apart", about, seconds, error) | {"judged": own | other}


def _spread(surface: completed_surface.Cloud, half: float, noise: float) -> dict[str, float]:
    """Medians; see the module."""
    seen, inferred = (float(np.median(surface.spread[which])) for which in (surface.seen, ~surface.seen))
    told = {"spread_seen": seen / half, "spread_inferred": inferred / half}
    return told | ({"seen_over_noise": seen / noise} if noise else {})


def _told(scores: cloud_scores.CloudScores) -> dict[str, float]:
    return dict(zip(SCORES, (1000 * scores.chamfer_l2_sq, 100 * scores.f_score_tau), strict=True))


def rows(category: str, split: str, found: dict[str, list[dict[str, float]]]) -> measuring.Rows:
    """A row for each way, of what it gave for each shape."""
    score = {way: np.array([one["f_score_tau_x100"] for one in each]) for way, each in found.items()}
    for way, each in found.items():
        table = {name: np.array([one[name] for one in each]) for name in each[0]}
        error = {
            name: float(np.median(values) if name in ("angle_deg", "scale_percent") else np.mean(values))
            for name, values in table.items()
            if name != "seconds"
        }
        for other, key in (("image", "f_gain"), ("nearest", "f_over_nearest"), ("sdf", "f_over_sdf")):
            if way not in ("image", other) and other in found:
                gain = claims.difference(score[way][None], score[other][None, : len(each)])
                error |= {key: gain.mean, f"{key}_error": gain.error}
        size = {"shapes": len(each), "points": POINTS}
        scores = {name: [float(f"{one[name]:.5g}") for one in each] for name in EACH if name in each[0]}
        yield measuring.row(f"{category}, {split}: {way}", size, table["seconds"].tolist(), error) | {"each": scores}


def main(
    *,
    split: Split = "test",
    categories: list[str] = ["chair", "plane"],  # noqa: B006
    ways: list[str] = ["mean", "nearest", *SCANS],  # noqa: B006
    run: str = "shipped",
    shapes: int = 100,
    few: int = 6,
) -> measuring.Rows:
    """Shapes of every category in turn.

    Args:
      split: the shapes.
      categories: their names.
      ways: the image is always there; and sdf.
      run: experiment of `sdf`, whose stage meshes is done.
      shapes: of a category at most.
      few: shapes for the ways of noise, outliers and lidar.
    """
    for category in categories:
        solver = Solver.of(shipped_models.place(category), completion.CompletionConfig())
        completers: dict[str, latent_distances.Completer] = {}
        for way, (steps, prior) in SETTINGS.items() if "sdf" in ways else ():
            model = latent_distances.of_run(Run.read(run, category), steps)
            completers[way] = latent_distances.Completer.of(model, dataclasses.replace(solver.config, prior=prior))
        every = manifest.of([category])
        known = [_cloud(row) for row in every if row.split == "train"] if "nearest" in ways else []
        mean = solver.cloud([each[0] for each in solver.decoder.modulations(solver.prior.mean[None])])
        found: dict[str, list[dict[str, float]]] = {way: [] for way in dict.fromkeys(("image", *ways, *completers))}
        for number, row in enumerate([row for row in every if row.split == split][:shapes]):
            given = case(row)
            for way in found:
                if way == "image":
                    found[way].append(solver.of_image(given))
                elif way == "nearest":
                    found[way].append(nearest(given, known))
                elif way == "mean":
                    found[way].append(nearest(given, [given.place.apply(mean)]))
                elif way in completers:
                    found[way].append(by_distances(completers[way], given))
                elif way in SCANS and (way in EVERY or number < few):
                    found[way].append(solver.of_scan(given, way, np.random.default_rng(number)))
            print(row.id, {way: round(own[-1]["f_score_tau_x100"], 1) for way, own in found.items()}, flush=True)
        yield from rows(category, split, found)
        yield told_apart(category, split, min(shapes, JUDGED))


def _cloud(row: manifest.Row) -> Float[np.ndarray, "n 3"]:
    made = shape(row)
    return Surface.of(Mesh(made.vertices, made.triangles)).draw(ICP_POINTS, np.random.default_rng(SEED))[0]
