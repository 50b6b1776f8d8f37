"""Level 0: errors, config files, artefact files, provenance, random streams, parallel maps, work that resumes."""
