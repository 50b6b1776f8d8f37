"""Settings of an experiment beside what the paper prints for them, with the place where it does.

A setting of which the paper says nothing is `NOT_GIVEN`: `configs/paper.yaml` then has a choice of this project.
"""

from typing import NamedTuple

NOT_GIVEN = "not given"


class Setting(NamedTuple):
    """name: as printed. key: in the experiment file. paper: as the file would say it. source: where the paper does."""

    name: str
    key: str
    paper: str = NOT_GIVEN
    source: str = ""

    @property
    def printed(self) -> str:
        """The paper's value and where it stands."""
        return f"{self.paper} ({self.source})" if self.source else self.paper


_LAYERS = "512, 512, 512, 256, 256, 256, 256"
_SI3DR, _SINGLE, _TABLE, _TEXT = "app. si3dr", "app. singlefits", "table si3dr", "§4.3"
SETTINGS = (
    Setting("image size of the encoders", "train.image_size", "128", _SI3DR),
    Setting("encoder", "train.encoder", "resnet", _SI3DR),
    Setting("encoder width (64 is ResNet-18)", "train.encoder_width", "64", _SI3DR),
    Setting("latent size", "train.latent_features", "512", _SI3DR),
    Setting("hidden layers of both decoders", "train.decoder.hidden", _LAYERS, _SI3DR),
    Setting("their first frequency, ω", "train.decoder.omega_first", "1.0", _SI3DR),
    Setting("images per step", "train.batch_size", "32", _SI3DR),
    Setting("weight of the camera loss, γ<sub>R,Π</sub>", "train.camera_weight", "5.0", _SI3DR),
    Setting("weight decay of the shape predictor", "train.weight_decay_shape", "0.001", _SI3DR),
    Setting("weight decay of the camera predictor", "train.weight_decay_camera", "1e-06", _SI3DR),
    Setting("azimuth of the camera", "train.azimuth", "angle", _SI3DR),
    Setting("learning rate", "train.loop.learning_rate", "0.0001", _SINGLE),
    Setting("course of the learning rate", "train.loop.schedule", "plateau", _SINGLE),
    Setting("steps of warm-up", "train.loop.warmup_steps"),
    Setting("gradients clipped to a norm of", "train.loop.clip_norm"),
    Setting("learning rate of Muon, for matrices between hidden layers", "train.loop.muon", "none", _SI3DR),
    Setting("DDF learning rate, where it is another", "ddf.learning_rate", "none", _SINGLE),
    Setting("DDF learning rate of Muon, where it is another", "ddf.muon", "none", _SINGLE),
    Setting("learning rate of the DDF's encoders, where it is another", "ddf.encoder_learning_rate", "none", _SI3DR),
    Setting("DDF depth activation", "ddf.field.depth_activation", "relu", _SINGLE),
    Setting("DDF first weights of directions, times those of positions", "ddf.field.direction_scale"),
    Setting("component that the depth loss is of", "ddf.weights.depth_of", "chosen", "§3.4"),
    Setting("error beyond which the depth loss is linear", "ddf.weights.depth_huber", "none", "§3.4"),
    Setting("DDF weight of the depth loss, γ<sub>d</sub>", "ddf.weights.depth", "5.0", _SI3DR),
    Setting("DDF weight of the visibility loss, γ<sub>ξ</sub>", "ddf.weights.visibility", "10.0", _SI3DR),
    Setting("DDF weight of the normal loss, γ<sub>n</sub>", "ddf.weights.normals", "10.0", _SI3DR),
    Setting("transition speed of L<sub>T</sub>, ε<sub>T</sub>", "ddf.weights.transition_speed"),
    Setting("DDF weight of the mask loss, γ<sub>R,M</sub>", "ddf.mask_weight", "10.0", _SI3DR),
    Setting("mask of that loss, pixels a side", "ddf.mask_size", "64", _SI3DR),
    Setting("pixels of it that are drawn for each image", "ddf.mask_pixels", "all", _SI3DR),
    Setting("extra uniform points of a shape in a step", "ddf.counts.E"),
    Setting("points of types U and A of a shape in a step", "ddf.counts.U", "1200", _SI3DR),
    Setting("points of each other type", "ddf.counts.S", "300", _SI3DR),
    Setting("samples of a step", "ddf.samples", "stored", _SI3DR),
    Setting("rays that the field proposes while training", "ddf.proposals", "none", _SI3DR),
    Setting("DDF steps", "ddf.steps", "100000", _SI3DR),
    Setting("PC-SIREN steps", "pcsiren.steps", "100000", _SI3DR),
    Setting("PC-SIREN points in the Chamfer loss", "pcsiren.points", "1024", _SI3DR),
    Setting("true points in the Chamfer loss", "pcsiren.truth_points", "1024", _SI3DR),
    Setting("meshes made watertight", "meshes.wrap", "auto", _SI3DR),
    Setting("triangles per training mesh, at most", "meshes.faces", "10000", _SI3DR),
    Setting("U and A samples per shape", "samples.counts.U", "20000", _SI3DR),
    Setting("other samples per shape and type", "samples.counts.S", "10000", _SI3DR),
    Setting("directions per point, n<sub>v</sub>", "pointclouds.cloud.num_directions", "128", _TEXT),
    Setting("cycles, N<sub>H</sub>", "pointclouds.cloud.cycles", "3", _TEXT),
    Setting("points of a cycle beyond those wanted, ε<sub>p</sub>", "pointclouds.cloud.oversampling", "0.1", _SI3DR),
    Setting("temperature of the directions' weights, η<sub>T</sub>", "pointclouds.cloud.temperature"),
    Setting("inverse depth of these weights, ε<sub>s</sub>", "pointclouds.cloud.inverse_depth"),
    Setting("a cycle starts beside the last hit by, σ", "pointclouds.cloud.jitter", "0.0", _TEXT),
    Setting("offsets at which a hit is rechecked", "pointclouds.cloud.recheck", "none", _TEXT),
    Setting("points spread by the power of their confidence", "pointclouds.cloud.spread", "none", _SI3DR),
    Setting("power by which lonely ones are taken later", "pointclouds.cloud.crowding", "0.0", _SI3DR),
    Setting("least confidence of a point", "pointclouds.cloud.least_confidence", "0.0", _SI3DR),
    Setting("share of the first directions aimed at the box", "pointclouds.cloud.aimed", "0.0", _TEXT),
    Setting("shapes moved to the mask, beside those as encoded", "pointclouds.shape_correction", "none", _TEXT),
    Setting("corrected by the mask", "pointclouds.correction.free", "azimuth, elevation, radius", _TEXT),
    Setting("steps of this correction", "pointclouds.correction.steps"),
    Setting("its learning rate", "pointclouds.correction.learning_rate"),
    Setting("its mask, pixels a side", "pointclouds.correction.mask_size", "64", _SI3DR),
    Setting("points L", "pointclouds.large", "5000", _TABLE),
    Setting("points S", "pointclouds.small", "2466", _TABLE),
    Setting("points of the cube that PC-SIREN maps", "pointclouds.pcsiren_inputs", "random", _SI3DR),
    Setting("test images per shape", "pointclouds.test_views"),
)
