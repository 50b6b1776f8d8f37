"""Commands about experiments and this machine."""
