"""What the package is measured against, written here."""
