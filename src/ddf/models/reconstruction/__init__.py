"""Single-image 3D reconstruction: encoders, DDF and PC-SIREN, inference. [DDF22] §4.3."""
