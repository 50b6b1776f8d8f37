"""What a field can be asked for, by name, with its unit: the one list that commands and fields read, without torch.

`ddf.fields.field_outputs` says of those that an ONNX file holds how they are computed; there weights are one array.
"""

COMPONENTS = {  # w_1, n_1, n_2 of the mixture's two components
    "weight_1": "share of component 1",
    "normals_1": "unit vectors of component 1",
    "normals_2": "unit vectors of component 2",
}
UNITS = {
    "visibility": "probability",
    "depth": "mesh units along the ray",
    "normals": "unit vectors, axes of the mesh",
    "mean_curvature": "1 / mesh unit",
    "gaussian_curvature": "1 / mesh unit²",
    **COMPONENTS,
}
