"""Records of other recorders (basin data acquisition, power analyser) brought onto a run's time."""
