"""Merging of records of other recorders (basin data acquisition, power analyser) into a run."""
