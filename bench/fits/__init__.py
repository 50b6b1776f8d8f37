"""What fits of single shapes reach: `make fit-proof`."""
