"""A truth to test against: tools, a rig with errors of its own, wells, logs, hand-held shots; knows no calibration."""
