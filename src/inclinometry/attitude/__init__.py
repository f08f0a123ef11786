"""Frames and signs, rotations and quaternions, the angles and back with derivatives, attitude from vectors."""
