"""The simulated crane: what moves it, and the sensor on its rope."""
