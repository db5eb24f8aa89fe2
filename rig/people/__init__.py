"""Requests of people to a run: their socket, the operator's seat, what they add to the plan."""
