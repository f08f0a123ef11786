"""From bench readings to the parameters of the sensors, with their uncertainty."""
