"""Benchmarks: speed beside error. `python -m bench` lists them; each is a module with a `main`, in a folder by subject.

A benchmark writes `reports/bench/<name>.json` (`lib.measuring`) and says what its section of the page shows
(`SECTION`, `lib.display`). It asserts nothing: that is for tests.
"""
