"""Search an archive of motion capture by what happens in it."""
