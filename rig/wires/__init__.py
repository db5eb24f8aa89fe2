"""What all rigs share of their wires: CAN service, pollers, locks, surveys."""
