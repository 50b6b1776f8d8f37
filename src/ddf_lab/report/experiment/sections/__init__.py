"""The sections of the experiment's page, one module each: `section(results)` with its words, tables and pictures."""
