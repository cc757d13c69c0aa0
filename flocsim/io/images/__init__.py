"""Pictures to masks: reading, background, threshold, regions, flocs that touch.  scikit-image."""
