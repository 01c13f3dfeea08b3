"""The page of a report: hits that move, in one HTML file that needs nothing from outside."""
