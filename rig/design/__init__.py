"""Design of a loop, for any rig: estimator gains, impedances, margins, steady motion, two-ports."""
