"""Level 5: trained models as ONNX files and as pages of the viewer."""
