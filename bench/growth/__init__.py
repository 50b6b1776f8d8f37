"""What grows with the number of shapes."""
