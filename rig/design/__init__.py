"""Design before a run: estimators, impedances, predictions, recommended gains."""
