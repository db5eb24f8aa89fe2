"""LUPA of Oregon State University: its feedback law and its gain schedules, for wec-rig."""
