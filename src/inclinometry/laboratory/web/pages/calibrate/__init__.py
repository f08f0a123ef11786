"""Guided calibration: choosing a plan, then one large card a position with live channels beside it."""
