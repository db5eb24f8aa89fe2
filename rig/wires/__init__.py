"""What all rigs share of their wires: CAN service, pollers, streams, surveys, scans."""
