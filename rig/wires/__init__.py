"""Wires of all rigs: CAN service, pollers, streams, surveys, scans."""
