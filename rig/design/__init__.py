"""Before a run: estimators, impedances, predictions, recommended gains."""
