"""Measure hits and annotations against labels, and motion templates against simpler methods."""
