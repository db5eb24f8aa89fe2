"""Execution of a plan: rehearsal, emulated or real hardware, replay."""
