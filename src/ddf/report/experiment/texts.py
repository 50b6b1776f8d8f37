"""The sentences of the report that do not depend on its numbers; {names} are filled in by `reports`."""

from typing import Final

LEAD: Final = """
Single-image 3D reconstruction with directed distance fields (DDF) and with PC-SIREN, a baseline of the same
architecture that maps points of a cube to surface points. Experiment `{name}`: {data}.
"""
SYNTHETIC: Final = "synthetic shapes in ShapeNet's layout"
SHAPENET: Final = "ShapeNet-v1 with 3D-R2N2 renders"
SOURCE: Final = (
    "Made by `make reproduce-table CONFIG=configs/{name}.yaml{seeds}`. All numbers are in [si3dr.csv](si3dr.csv)."
)
SEEDS: Final = """
Numbers with ± are means over {seeds} seeds of training and cloud drawing, ± the sample standard deviation over seeds;
no training changes the other numbers.
"""
SEED_MEANS: Final = "Of means over {seeds} seeds."
SEED_ZERO: Final = "Of the first of the {seeds} seeds."
SEED_MEDIANS: Final = "Medians over the {seeds} seeds."

RESULTS: Final = """
Single-image reconstruction, laid out as the paper's table `si3dr`. D<sub>C</sub>: Chamfer distance × 1000, the sum
of both means of squared distances; F<sub>τ</sub>: F-score × 100 at squared distance ≤ τ = {tau} (benchmark units,
0.57 × v1). L and S are {large} and {small} predicted points against the whole true cloud. Π<sub>g</sub>: true
camera; Π̂: predicted camera and estimated scale; Π̂<sub>∇</sub>: predicted camera after gradient descent on the
mask. Means over images. Bold: the better of our two models in the same column.
"""
SILHOUETTES: Final = """
Before its clouds are drawn, a shape of DDF moves until its silhouette from the predicted camera agrees with the image's
alpha channel (`cloud_projection.shape_correction`); PC-SIREN has no visibility to do so with.
"""
PAPER_COLUMNS: Final = """
Grey columns are the paper's own numbers on ShapeNet: other data and other sizes, not comparable cell by cell; the
paper takes P2M and 3DR from Pixel2Mesh, where they predict in the frame of the view.
"""
MEAN_SHAPE: Final = """
{label} at the true camera, L points: the mean shape's D<sub>C</sub> is {ratios} times that of {label} (above 1:
{label} is better).
"""
CORRECTION: Final = "Correcting the predicted camera by the mask, S points, changes D<sub>C</sub>: {changes}."

PICTURES: Final = """
Test images from the best to the worst of the {count} rendered per category, by D<sub>C</sub> of DDF at the true
camera. Visibility, depth, normals and both clouds are seen from the predicted camera at the predicted scale, with
no post-processing; the truth is seen from the true camera. Depth: yellow is near. Normals: (n + 1)/2 as RGB.
Clouds: colours are 3D coordinates.
"""
STRIP: Final = "{category}: best to worst."
STRIP_ALT: Final = """
{category}: input, visibility, depth, normals, DDF cloud, PC-SIREN cloud and true cloud of several test images
"""

BASELINES: Final = """
What the numbers mean, at the true camera. Ceiling: a random subset of the truth against all of it, which is what a
perfect method reaches with that many points; visible points are those that some ray from outside meets first.
Oracle retrieval knows the truth and takes the training shape with the smallest D<sub>C</sub>; retrieval takes the
shape of the training image whose encoder feature is nearest; the mean shape is drawn from all training clouds
together. Bold: the best of both models, retrieval and the mean shape.
"""
BARS: Final = "F-scores at the true camera, L points."
ONE_CYCLE: Final = """
As the paper's table `si3dr1h`: points are projected onto the surface once (N<sub>H</sub> = 1) instead of {cycles}
times. Bold: the better of one cycle and {cycles}.
"""
CAMERAS: Final = """
Median absolute errors over test images of the predicted cameras, before (Π̂) and after (Π̂<sub>∇</sub>) the
correction by the mask, and of the scale estimated from the diagonal of the predicted cloud; and the share of images
whose azimuth is so far off that the descent ends in another basin.
"""
CAMERA_CURVES: Final = "Share of test images whose azimuth error is at most so large."
SCATTER: Final = """
Every test image as a point, true camera, L points: below the diagonal DDF has the smaller D<sub>C</sub>.
Logarithmic axes.
"""
SHAPES: Final = """
Every test shape as a point, the mean over its images, true camera, L points: below the diagonal DDF has the smaller
D<sub>C</sub>. Logarithmic axes.
"""
DISTANCES: Final = """
Both models at the true camera, L points: their scores less those of the ceiling (truth against itself), and less those
of the retrieved training shape. Bold: better than retrieval.
"""
SPLIT: Final = """
Where the error comes from, S points. Ceiling: the truth against itself. Shape: what the model adds at the true camera
and scale. Camera: what the predicted camera (Π̂, or Π̂<sub>∇</sub> after gradient descent on the mask) and the
estimated scale add to that.
"""
AZIMUTH: Final = """
Errors over the true azimuth of the camera, about the upright axis: above, of the shape (true camera, L points); below,
of the predicted camera. Every test image as a point, lines are medians over {sectors} equal sectors. Logarithmic
values; those below 1/{range} of the largest are drawn there.
"""
EVENNESS: Final = """
How evenly the clouds lie, L points: standard deviation over mean of the distance from a point to the nearest other
one, mean over images. The true clouds are Poisson-disk samples, whose points keep a distance; independent points
spread evenly over a surface have 0.52 (Rayleigh's distribution), and more says that points crowd.
"""
SAME_BUDGET: Final = "Both models trained for the same wall time within {more} %, summed over categories: {spent}."
OTHER_BUDGET: Final = """
The models did not train for the same wall time: summed over categories {spent}, the longer {more} % above the shorter.
"""
CURVES: Final = "Total loss (thick, smoothed) and its terms without their weights."
TRAINING: Final = "Training losses. The two models minimise different losses: compare within one model only."
DATA: Final = """
Data, and what preparation lost. Hidden points of the true clouds are those that no ray from outside meets first;
they count in the metrics, as in Pixel2Mesh. Surface lost: distances between the raw and the training mesh.
"""
TIMES: Final = """
Wall time of each stage's last run, summed over categories, on a machine with {threads} CPU threads. Those of
several categories run side by side, so the whole takes less than the sum. Of a stage that was resumed, only the last
part is counted. Memory: the largest resident memory of the stage's process, and of the largest of its worker
processes where it has any (one per CPU thread, two at least), in any category; shared pages count in each.
"""

LIMIT_SYNTHETIC: Final = """
The shapes are procedural, made by this project in ShapeNet's layout with the same cameras. Their scores say how the
methods behave and compare on these shapes; they do not reproduce the paper's ShapeNet numbers.
"""
LIMIT_SIZES: Final = "Sizes differ from the paper's (table below), and so does every number that depends on them."
LIMIT_SEED: Final = """
One seed was trained. The standard errors in [si3dr.csv](si3dr.csv) are over images and say nothing about other seeds.
"""
LIMIT_SEEDS: Final = """
{seeds} seeds were trained, all on the same data set and samples. In [si3dr.csv](si3dr.csv) `seeds` says of how many a
number is the mean; where that is more than one, `spread` is the sample standard deviation over seeds, else the standard
error over images.
"""
LIMIT_QUOTED: Final = "P2M and 3D-R2N2 were not run here; their columns are quoted."
SETTINGS: Final = "Settings that differ from the paper's; `configs/paper.yaml` has the paper's."


def fill(text: str, **values: object) -> str:
    """One paragraph on one line, its {names} replaced."""
    return " ".join(text.split()).format(**values)
