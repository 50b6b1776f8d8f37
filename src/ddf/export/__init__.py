"""Level 5: trained models as ONNX files, compared with torch before they are written."""
