"""The models of a WaveBot's configuration files."""
