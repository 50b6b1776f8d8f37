"""The paper's ablation of sample types, as data. [DDF22] table `dataablation`, Stanford bunny.

25K held-out samples per type; 500K training samples in every row: 100K of each type but the one left out, 83,333 of
all six in the row `none`.
"""

SOURCE = "paper, bunny"
COLUMNS = ("U", "A", "B", "O", "T", "S")  # held-out type, as printed from left to right

# Left-out type -> L1 x 10 of the depth, then BCE of the visibility, per held-out type.
DEPTH_L1_X10 = {
    "U": (0.58, 0.79, 0.18, 0.49, 0.75, 0.47),
    "A": (0.48, 0.82, 0.20, 0.49, 0.81, 0.54),
    "B": (0.37, 0.67, 0.20, 0.46, 0.73, 0.58),
    "O": (0.39, 0.67, 0.18, 0.56, 0.70, 0.59),
    "T": (0.39, 0.70, 0.19, 0.45, 0.84, 0.65),
    "S": (0.55, 0.95, 0.23, 0.51, 0.89, 1.43),
    "none": (0.45, 0.75, 0.19, 0.50, 0.77, 0.67),
}
VISIBILITY_BCE = {
    "U": (2.11, 0.03, 0.07, 0.56, 0.14, 0.05),
    "A": (0.20, 0.05, 0.07, 0.49, 0.18, 0.07),
    "B": (0.20, 0.03, 0.10, 0.50, 0.15, 0.06),
    "O": (0.28, 0.01, 0.11, 1.71, 0.03, 0.03),
    "T": (0.19, 0.09, 0.06, 0.32, 0.48, 0.07),
    "S": (0.14, 0.06, 0.06, 0.42, 0.17, 0.48),
    "none": (0.23, 0.04, 0.08, 0.56, 0.15, 0.07),
}
METRICS = {"depth_l1_x10": DEPTH_L1_X10, "visibility_bce": VISIBILITY_BCE}
