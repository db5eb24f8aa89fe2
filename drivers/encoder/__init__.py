"""Absolute angle encoders: SSI words, the two-channel bridge that sends them, unwrapping."""
