"""What training on a GPU has beside that on a CPU: data in its memory."""
