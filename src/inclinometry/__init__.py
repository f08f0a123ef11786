"""Inclinometry: borehole inclinometers made trustworthy, from the bench to the bottom of the hole."""
