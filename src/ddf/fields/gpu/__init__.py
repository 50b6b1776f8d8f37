"""What a GPU runs in another way than a CPU: compiled passes, an order of points by one kernel."""
