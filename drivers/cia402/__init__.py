"""Drives and actuators of the profile CiA 402, on any wire: pure functions and state machines.

They own no wire and read no clock: ages and counts of ticks are arguments.
"""
