"""The journal beside an unfinished results file: records with checksums, appended as they come."""
