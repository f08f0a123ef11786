"""Words of a report on a moving tool: what each method does, and what to do about each flag."""

from __future__ import annotations

from typing import Final

METHOD_WORDS: Final = {
    "static": "means of gravity and field of a tool at rest",
    "quaternion": "the same, gravity and field both weighted (Davenport's q)",
    "magnetic": "turned back by the magnetic phase, weighted least squares with the lever arm",
    "mean": "turned back by the magnetic phase, plain mean",
    "gyro": "carried on by the gyros, gravity and Earth rate",
    "complementary": "carried on by the gyros, gravity and field through low-passes in the almost-inertial frame",
    "filter": "15-state filter with gravity and field",
    "robust": "robust adaptive filter over windows",
    "smoother": "filter run forward and backward",
    "survey": "gyros alone between two stations, drift closed at both",
}
"""What each of `METHODS` does, in one line."""

REMEDIES: Final = {
    "clipped": "Nothing brings clipped peaks back: accelerometers of a wider range, a softer mount, or less shock.",
    "stuck": "Check wiring and converter of the channel.",
    "gap": "Look for the cause in recorder or telemetry; the rows beside the gap are good.",
    "aliased": "Sample faster, or survey at a lower speed: below half a turn from sample to sample.",
    "no-field": "Use a method that rests on gyros here, or survey outside the casing.",
    "little-arc": "State the magnetic offsets by a calibration, or take a window that holds a whole turn.",
    "offset": "State the magnetic offsets by a calibration, or take a window that holds a whole turn.",
    "disturbed": "Look for steel nearby; check strength and dip of the field in the site file.",
    "vibration": "Take a longer window, or survey while it shakes less.",
    "not-still": "Leave the tool at rest longer, or let the window be treated as moving.",
    "step": "Correct the delay reported where the channels are recorded.",
    "axes": "Correct the axis map before any angle is believed.",
    "misfit": "Look at the run here: the motion is not as the method has it, or the noise is stated too small.",
    "start": "Leave these rows out, or let the filter start earlier.",
    "drift": "Give the gyros an update: a stop of the string, or a stretch with a usable field.",
    "vertical": "Use azimuth + toolface; azimuth alone has no meaning here.",
    "unobservable": "A magnetometer, gyros that see the Earth turn, or a known start are needed for an azimuth.",
}
"""What to do about each of `FLAGS`."""

CHANNEL_WORDS: Final = {"accel": "apparent gravity", "mag": "magnetic field", "gyro": "rotation rate"}
"""What each triad of `CHANNELS` reads."""
