#!/bin/sh
# Takes in what is new, and annotates it. For cron; see crontab beside this file.
#
#   nightly.sh FOLDER     with FOLDER/takes, and FOLDER/classes.h5 from learn-mt
#
# One run at a time: whoever comes while another is at work says so in the log and leaves.
set -eu
cd "$1"
exec >>nightly.log 2>&1 9>nightly.lock
if ! flock --nonblock 9; then
    echo "$(date -u +%FT%TZ) another run is at work"
    exit 0
fi
echo "$(date -u +%FT%TZ) begins"

# Code 5 is "done, but some files could not be used"; they stand in the log. Any other failure ends
# the run here: cron sees the code, and yesterday's annotations are still whole.
mocapidx index takes --store takes.store --skip-bad --prune || test $? -eq 5
mocapidx annotate takes.store --templates classes.h5 --format csv --output annotations.csv

echo "$(date -u +%FT%TZ) done"
