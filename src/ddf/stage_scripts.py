"""Which script is which stage of an experiment, and which run once for all categories; their notes are named so."""

SCRIPTS = {  # by stage, in the order of the pipeline; without those beside it (export_onnx) and the report itself
    "dataset": "make_dataset",
    "meshes": "prepare_meshes",
    "samples": "extract_samples",
    "train_ddf": "train_ddf",
    "train_pcsiren": "train_pcsiren",
    "pointclouds": "make_pointclouds",
    "evaluate": "evaluate_clouds",
}
WHOLE = ("dataset", "evaluate")  # these run once, all others for each category
