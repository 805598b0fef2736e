"""The pendulum: equations of motion and gravity, shared by simulated devices, the swing estimator and the twin."""
