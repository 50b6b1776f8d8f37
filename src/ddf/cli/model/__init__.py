"""Commands about trained models: list, use and export them."""
