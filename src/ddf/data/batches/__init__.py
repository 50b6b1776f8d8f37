"""What a training draws its batches from: images, cameras and samples of a category, on disk or on a device."""
