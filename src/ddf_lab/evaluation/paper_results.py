"""The numbers that the paper prints, as data, with the labels of the tables they come from.

[DDF22] tables `si3dr` and `si3dr1h`: ShapeNet-v1 with 3D-R2N2 renders; D_C x 1000, F_tau x 100, F_2tau x 100. P2M and
3DR are quoted there from Pixel2Mesh and are not directly comparable with `Pi_g` columns. Never mixed with numbers
measured on other data: every row says `paper, ShapeNet`. Table `dataablation`: sample types left out of fits to the
Stanford bunny, `paper, bunny`.
"""

import pandas as pd

SOURCE = "paper, ShapeNet"
METRICS = ("chamfer_l2_sq_x1000", "f_score_tau_x100", "f_score_2tau_x100")  # that the paper prints

_DDF_COLUMNS = ("Pi_g-L", "Pi_g-S", "Pi_corrected-S", "Pi_pred-L", "Pi_pred-S")
_FOUR_COLUMNS = ("Pi_g-L", "Pi_g-S", "Pi_pred-L", "Pi_pred-S")

# Table `si3dr`: category -> one line per metric, the columns as printed from left to right.
SI3DR_COLUMNS = (
    *(("ddf", column) for column in _DDF_COLUMNS),
    *(("pc_siren", column) for column in _FOUR_COLUMNS),
    ("p2m", "view frame"),
    ("3dr", "view frame"),
)
SI3DR = {
    "chair": (
        (0.459, 0.512, 0.823, 0.855, 0.919, 0.431, 0.465, 0.876, 0.915, 0.610, 1.432),
        (55.47, 48.40, 42.28, 47.51, 41.08, 62.25, 56.36, 50.56, 45.57, 54.38, 40.22),
        (72.82, 67.75, 60.39, 63.81, 58.98, 77.38, 74.56, 65.43, 62.76, 70.42, 55.20),
    ),
    "plane": (
        (0.210, 0.239, 0.673, 0.793, 0.836, 0.215, 0.227, 0.829, 0.844, 0.477, 0.895),
        (80.46, 76.62, 63.32, 63.75, 60.54, 81.49, 80.11, 63.64, 62.34, 71.12, 41.46),
        (90.05, 88.55, 76.16, 74.96, 73.47, 89.71, 89.18, 74.76, 74.18, 81.38, 63.23),
    ),
    "car": (
        (0.231, 0.288, 0.390, 0.541, 0.606, 0.371, 0.400, 0.737, 0.768, 0.268, 0.845),
        (70.91, 59.93, 54.16, 62.69, 52.47, 64.57, 57.82, 56.01, 50.04, 67.86, 37.80),
        (86.57, 79.66, 74.68, 79.71, 72.78, 78.72, 76.00, 71.22, 68.52, 84.15, 54.84),
    ),
}

# Table `si3dr1h` (N_H = 1).
SI3DR1H_COLUMNS = tuple(("ddf_nh1", column) for column in _FOUR_COLUMNS)
SI3DR1H = {
    "chair": ((0.477, 0.532, 0.861, 0.928), (54.37, 47.26, 46.81, 40.35), (71.62, 66.33, 63.09, 58.09)),
    "plane": ((0.201, 0.231, 0.748, 0.799), (80.69, 76.71, 63.86, 60.48), (90.23, 88.49, 75.30, 73.55)),
    "car": ((0.235, 0.309, 0.545, 0.628), (68.21, 57.36, 59.84, 49.98), (83.99, 76.41, 76.87, 69.32)),
}

BUNNY = "paper, bunny"
BUNNY_TYPES = ("U", "A", "B", "O", "T", "S")  # held-out type, as printed from left to right

# Table `dataablation`, with 25K held-out samples per type and 500K training samples in every row: 100K of each type but
# the one left out, 83,333 of all six in the row `none`. Left-out type -> errors per held-out type.
_DEPTH_L1_X10 = {
    "U": (0.58, 0.79, 0.18, 0.49, 0.75, 0.47),
    "A": (0.48, 0.82, 0.20, 0.49, 0.81, 0.54),
    "B": (0.37, 0.67, 0.20, 0.46, 0.73, 0.58),
    "O": (0.39, 0.67, 0.18, 0.56, 0.70, 0.59),
    "T": (0.39, 0.70, 0.19, 0.45, 0.84, 0.65),
    "S": (0.55, 0.95, 0.23, 0.51, 0.89, 1.43),
    "none": (0.45, 0.75, 0.19, 0.50, 0.77, 0.67),
}
_VISIBILITY_BCE = {
    "U": (2.11, 0.03, 0.07, 0.56, 0.14, 0.05),
    "A": (0.20, 0.05, 0.07, 0.49, 0.18, 0.07),
    "B": (0.20, 0.03, 0.10, 0.50, 0.15, 0.06),
    "O": (0.28, 0.01, 0.11, 1.71, 0.03, 0.03),
    "T": (0.19, 0.09, 0.06, 0.32, 0.48, 0.07),
    "S": (0.14, 0.06, 0.06, 0.42, 0.17, 0.48),
    "none": (0.23, 0.04, 0.08, 0.56, 0.15, 0.07),
}
BUNNY_METRICS = {"depth_l1_x10": _DEPTH_L1_X10, "visibility_bce": _VISIBILITY_BCE}


def long_table(categories: list[str]) -> pd.DataFrame:
    """The paper's rows of the named categories in the form of si3dr.csv; it prints no image or seed counts."""
    rows = [
        {"category": category, "method": method, "column": column, "metric": metric, "value": value, "source": SOURCE}
        for heads, numbers in ((SI3DR_COLUMNS, SI3DR), (SI3DR1H_COLUMNS, SI3DR1H))
        for category in categories
        for metric, line in zip(METRICS, numbers.get(category, ()), strict=bool(category in numbers))
        for (method, column), value in zip(heads, line, strict=True)
    ]
    fields = ["category", "method", "column", "metric", "value", "images", "seeds", "spread", "source"]
    return pd.DataFrame(rows, columns=fields)
