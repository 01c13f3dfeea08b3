"""Recordings to motions: rotations, forward kinematics, canonical joints, resampling."""
