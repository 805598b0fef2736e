"""The motion of the rope at every moment: a recursive estimator that weighs hypotheses on what acts on crane and load."""
