"""Recording: rows, ring, logger, run folders, calibrations."""
