"""Level 0: errors, files, provenance, random streams, parallel maps, processes, work that resumes."""
