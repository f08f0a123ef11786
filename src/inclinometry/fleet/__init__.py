"""Many tools, many runs, years of calibrations: raw counts kept once, everything made of them redone when a calibration
changes.

The unit is a file: `task.run` turns one file of counts into one file of results, the same bytes whoever does it. `plan`
says by arithmetic on names what is to be done, `workers` does it, `commit` alone writes down what is current.
"""
