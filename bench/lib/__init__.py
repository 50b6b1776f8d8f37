"""What benchmarks share: measuring, reading results, comparing runs, the page and its pictures."""
