"""When a relay is energised, and the words between the gateway and the process that switches it."""
