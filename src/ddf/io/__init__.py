"""Level 5: trained models as ONNX files and as pages of the viewer."""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # of onnxruntime, which would write to HOME and send what it finds
