"""The WaveBot's compiled tick with its plant, for sweeps."""
