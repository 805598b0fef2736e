"""A crane that is not there: equations of motion, what moves it, and the sensor on its rope."""
