"""The models that come with the package: small files and their cards."""
