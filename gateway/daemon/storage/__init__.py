"""What is kept on the disk: recordings, the outbox, calibration records and the state of the drift monitor."""
