"""An image becomes a thing: one image or many, framing, agreement with silhouettes, colours, new shapes."""
