"""Commands about fields: fit one, ask it, draw it."""
