"""Analysis products of WaveBot runs beyond the power surfaces."""
