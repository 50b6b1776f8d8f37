"""Reconstruction from an image or a scan, samples, poses."""
