"""Pages of experiments: charts, tables, pictures."""
