"""Experiment design: the experiment that separates effects which an ordinary recording cannot distinguish."""
