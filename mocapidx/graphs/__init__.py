"""Match webs: which stretches of motion are numerically alike, and the graphs of what was found."""
