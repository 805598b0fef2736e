"""What every thread and the process need: queues, faults, log, data folder, clock, watchdog and shutdown."""
