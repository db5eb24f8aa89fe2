"""Absolute angle encoders: SSI words, the two-channel bridge that carries them, unwrapping."""
