"""The figures of the paper, remade with our own shapes, each with numbers against exact values."""
