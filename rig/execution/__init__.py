"""Running a plan: rehearsal, real wires, replay."""
