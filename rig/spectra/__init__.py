"""Spectral lines of recorded signals: repeat periods, wave lines, the sea without the device."""
