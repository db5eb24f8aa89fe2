"""Values of the OSWEC thesis (University of Washington), for comparison with those of a run."""

CURRENTS = (1.12, 1.40, 1.68, 1.96, 2.23, 2.51, 2.79, 3.35, 3.63, 3.91, 4.19, 4.47)
TORQUES = (17.31, 21.63, 25.97, 30.29, 34.62, 38.95, 43.28, 51.93, 56.26, 60.59, 64.91, 69.24)
"""Table 3.1, A and N*m: current amplitudes and nominal torques."""

VOLTS = (0.23, 0.35, 0.47, 0.58, 0.70, 0.81, 0.93)
SPEEDS = (0.37, 0.55, 0.73, 0.92, 1.10, 1.28, 1.46)
"""Table 3.2, V and rad/s: voltage amplitudes and nominal velocities."""

TORQUE_CONSTANT = 16.72  # N*m/A, mean of all ramps
TORQUE_CONSTANTS = (15.56, 18.42)  # smallest and largest
TORQUE_SPECIFIED = 16.845  # 1.123 * 15
TORQUE_SPREADS = (0.17, 0.11)  # clockwise and counter-clockwise, shares of their means

VELOCITY_CONSTANT = 1.46  # rad/s/V, mean of all
VELOCITY_FASTEST = 1.49  # mean of the three fastest
VELOCITY_CONSTANTS = (1.22, 1.52)
VELOCITY_SPREAD = 0.028  # of the three fastest

UNLOADED_DIFFERENCE = (0.025, 0.015)  # deg, amplitude difference and its half width


def matching_value(
    value: float, first_column: tuple[float, ...], second_column: tuple[float, ...]
) -> float:
    """Return the thesis's second column for a first one, within 2 %; NaN if it has no such row."""
    for first, second in zip(first_column, second_column, strict=True):
        if abs(value / first - 1.0) < 0.02:
            return second
    return float("nan")
