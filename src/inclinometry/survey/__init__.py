"""From raw channels of a calibrated tool to stations: inclination, azimuth, toolface with their uncertainty."""
